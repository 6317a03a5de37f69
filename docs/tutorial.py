# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
# ---

# %% [markdown]
# # Tutorial: from a sine to the class of a texture
#
# A quarter of an hour, every step with its result. One taxel sees a sine; its events are rebuilt into the signal;
# the hardware sends the same events; a waveform shows why; then 64 taxels slide over brick, grass and gravel, and
# a network says which it was.
#
# Run it from the top of the project with `.venv/bin/python` (after `make setup`), cell by cell or whole:
# `docs/tutorial.py` is the source of this page and of a notebook.

# %% [markdown]
# ## One sine, and its events
#
# `ReadoutConfig` holds every parameter of a readout. Here one taxel samples a signal at 20 kHz with 12 bits. At a
# resolution of 4 bits an LSB is 2^-4 of full scale, and the encoder steps by half of that: 64 codes.

# %%
import matplotlib.pyplot as plt
import numpy as np

from eskin.model.config import ReadoutConfig

config = ReadoutConfig(rows=1, columns=1, encoding="lcs", resolution=4)
seconds = np.arange(400) / config.sample_rate_hz  # 20 ms
signal = np.rint(0.8 * config.full_scale * np.sin(2 * np.pi * 100 * seconds)).astype(np.int16)
samples = signal[:, None]  # (sample ticks, taxels)
print(f"step D = {config.step} codes of {config.full_scale}, clock {config.clock_hz:,.0f} Hz")

# %% [markdown]
# Level crossing: whenever the signal is a step above the reference the taxel sends an ON event and the reference
# follows by that step; below it an OFF event. Where the sine is steep events are close, at its turns there are
# none.

# %%
from eskin.model.taxel import decode, encode_timed, error_bound, uncontended_events

counts, late = encode_timed(config, samples)
events = uncontended_events(config, counts, late)
print(f"{len(events)} events, {events['p'].sum()} of them ON; the first three:")
for t, x, y, p in events[:3].tolist():
    print(f"  clock {t}, row {y}, column {x}, {'ON' if p else 'OFF'}")

# %% [markdown]
# ## The decoder and its bound
#
# The events are enough to rebuild the reference, exactly. It stays within a step of the signal, and that is a
# promise: `error_bound` says how far off a reconstruction may be, as long as the signal is not too steep.

# %%
rebuilt = decode(config, counts, late)[:, 0]
low, high = error_bound(config)
error = signal - rebuilt
print(f"error from {error.min():.0f} to {error.max():.0f} codes; promised from {low:.0f} to {high:.0f}")

figure, (above, below) = plt.subplots(2, 1, figsize=(8, 4.5), sharex=True, height_ratios=[3, 1], layout="constrained")
above.plot(seconds * 1e3, signal / config.full_scale, color="0.5", label="signal")
above.step(seconds * 1e3, rebuilt / config.full_scale, where="post", color="C0", lw=1, label="rebuilt from the events")
for on, colour in ((True, "C2"), (False, "C3")):
    times = events["t"][events["p"] == on] / config.clock_hz * 1e3
    above.plot(times, np.full(len(times), -1.0), "|", color=colour, label="ON" if on else "OFF")
above.legend(loc="upper right", ncols=2, fontsize="small")
above.set(ylabel="full scales")
below.plot(seconds * 1e3, error, color="0.3", lw=1)
below.axhline(low, color="C3", lw=0.8)
below.axhline(high, color="C3", lw=0.8)
_ = below.set(xlabel="time / ms", ylabel="error, codes")

# %% [markdown]
# The other encoders are a word in the configuration. CW-LCS closes its window while nothing happens, as at
# the turns of the sine, and so sees smaller changes; N-LCS is one comparator whose threshold leaks, a leaky
# neuron, and sends no OFF events; bipolar N-LCS sends both. [Encoders](reference/encoders.md) has their rules.

# %%
from eskin.model.encoders import registry

for encoding in registry.NAMES:
    other = config.replace(encoding=encoding, window_period=4)
    print(f"{encoding:12} {np.abs(encode_timed(other, samples)[0]).sum():4} events")

# %% [markdown]
# ## Clock by clock
#
# So far every event left at once. `simulate` is the whole readout, with arbiter and link, clock by clock: three
# clocks from a sample to its first event. For a lone taxel the two models agree; four taxels that see the same
# sine have to share the link, and wait for each other.

# %%
from eskin.model.readout import Stimulus, simulate

stimulus = Stimulus.from_samples(config, samples)
model_events = simulate(config, stimulus)
assert np.array_equal(model_events, events)
four = config.replace(columns=4)
print(simulate(four, Stimulus.from_samples(four, samples.repeat(4, axis=1)))[:5])

# %% [markdown]
# ## The same through the RTL
#
# The hardware is written in Amaranth, which brings a simulator. This plays the same samples into `eskin_readout`
# and notes three of its ports in every clock: `event_valid` with `event_ready` is the transfer of an event.

# %%
from amaranth.sim import Simulator

from eskin.rtl.readout import Readout

top = Readout(config)
event_clocks, trace = [], []


async def bench(ctx):
    ctx.set(top.taxel_enable, 1)
    ctx.set(top.event_ready, 1)
    for clock in range(stimulus.clocks):
        tick, phase = divmod(clock, config.clocks_per_sample)
        ctx.set(top.sample, int(samples[tick, 0]))
        ctx.set(top.sample_valid, phase == 0)
        valid, polarity = ctx.get(top.event_valid), ctx.get(top.event_polarity)
        trace.append((phase == 0, valid, polarity))
        if valid:
            event_clocks.append((clock, polarity))
        await ctx.tick()


simulator = Simulator(top)
simulator.add_clock(1 / config.clock_hz)
simulator.add_testbench(bench)
simulator.run()
assert event_clocks == [(t, int(p)) for t, p in zip(model_events["t"], model_events["p"], strict=True)]
print(f"RTL and model: {len(event_clocks)} events, the same clocks, the same polarities")

# %% [markdown]
# ## A waveform
#
# The clocks around the first event. The sample that crosses the threshold is taken where `sample_valid` is high;
# the taxel decides, the arbiter grants, and in the third clock after it `event_valid` is high.
# [Microarchitecture](design/microarchitecture.md) has the whole table.

# %%
first = event_clocks[0][0]
window = np.arange(first - 6, first + 6)
figure, axes = plt.subplots(3, 1, figsize=(8, 2.4), sharex=True, layout="constrained")
for axis, name, column in zip(axes, ("sample_valid", "event_valid", "event_polarity"), range(3), strict=True):
    axis.step(window, np.array(trace)[window, column], where="post", color="C0")
    axis.set(ylim=(-0.2, 1.2), yticks=[])
    axis.set_ylabel(name, rotation=0, ha="right", va="center", family="monospace")
    axis.spines[["top", "right", "left"]].set_visible(False)
_ = axes[-1].set(xlabel="clock", xticks=window)

# %% [markdown]
# That was Amaranth's simulator. What is delivered is Verilog, and `make sim` holds that to the model in Icarus or
# Verilator, over many stimuli, and leaves a waveform for GTKWave:

# %%
import subprocess
import sys
import tempfile

folder = tempfile.mkdtemp()
options = "--rows 1 --columns 1 --encoding lcs --resolution 4 --sim icarus --textures 0 --waves"
done = subprocess.run(
    [sys.executable, "-m", "eskin", "sim", *options.split(), "--out", folder],
    capture_output=True,
    text=True,
    check=True,
)
print(done.stdout.replace(folder, "out/sim"))

# %% [markdown]
# ## A texture's class
#
# Now 8 x 8 taxels slide over photographs of brick, grass and gravel at 65 mm/s. `record` is one image through
# scan, sensor model and readout.

# %%
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.physical import PhysicalScan
from eskin.snn.data.record import record, record_dataset

textures, scan = open_dataset("embedded"), PhysicalScan()
array = scan.configure(ReadoutConfig(resolution=4), None)
recording = record(textures[0], textures.name, scan, array)
print(f"{textures[0].name}: {len(recording.events)} events in {recording.duration_s:.3f} s")

figure, (image, raster) = plt.subplots(1, 2, figsize=(9, 2.6), width_ratios=[1, 2], layout="constrained")
image.imshow(textures[0].load(), cmap="gray")
image.set(xticks=[], yticks=[], title=textures[0].class_name)
taxel = recording.events["y"] * array.columns + recording.events["x"]
raster.scatter(
    recording.events["t"] / array.clock_hz * 1e3, taxel, s=0.2, c=np.where(recording.events["p"], "C2", "C3")
)
_ = raster.set(xlabel="time / ms", ylabel="taxel", title="address events, ON green, OFF red")

# %% [markdown]
# A network does not see single events but their counts in bins, here of 2 ms: 128 channels, one for each taxel
# and polarity. All 48 images are recorded; 36 are learned and 12 kept for the test. Neurons that leak, outputs
# that do not fire. Twenty epochs take seconds and are enough to see that it works;
# [Classifier](guide/classifier.md) has the real trainings, with six textures and a protocol.

# %%
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.scans import Split
from eskin.snn.network_config import NetworkConfig
from eskin.snn.train import predicted_classes, train
from eskin.snn.training import TrainConfig

data = record_dataset(textures, scan, array, BinConfig(bin_s=0.002))
test = np.arange(0, len(textures), 4)
learned = np.setdiff1d(np.arange(len(textures)), test)
leaky = {"hidden": 64, "decay": 0.8, "output_decay": 0.95, "readout": "membrane", "input_rms": 2.0, "dropout": 0.3}
network = NetworkConfig.from_dict({"inputs": data.channels, "classes": len(data.class_names)} | leaky)
course = TrainConfig.from_dict({"epochs": 20, "batch": 8, "cosine": True, "weight_decay": 0.01, "shift_steps": 10})
training = train(Split(data, learned), network, course, seed=0)
right = predicted_classes(training.network, data, test) == data.image_labels[test]
print(f"{right.sum()} of {len(test)} test images are read right")

# %% [markdown]
# How much of a scan does it need? The same network on the first few bins of one test image, then on more and more
# of them:

# %%
import torch

number = test[0]
counts = data.batch([number])
with torch.no_grad():
    heard = [training.network.eval()(counts[: bins + 1]).logits.softmax(1)[0] for bins in range(data.steps)]
figure, axis = plt.subplots(figsize=(8, 2.4), layout="constrained")
for name, evidence in zip(data.class_names, torch.stack(heard).T, strict=True):
    axis.plot(np.arange(data.steps) * data.step_s * 1e3, evidence, label=name)
axis.legend(loc="center right", fontsize="small")
_ = axis.set(xlabel="time / ms", ylabel="SoftMax", ylim=(-0.05, 1.05), title=data.names[number])

# %% [markdown]
# ## Your own sensor
#
# A slow piezoresistive skin: 16 taxels, 35 samples a second, raw counts on a baseline of thousands, a time stamp in
# the first column, a folder for each class. Here it is generated; yours may have decimal commas, other columns and
# stamps that jitter.

# %%
import os
from pathlib import Path

generator = np.random.default_rng(0)
skin = Path(tempfile.mkdtemp()) / "my_skin"
stamps = np.arange(0, 4, 1 / 35)[:, None]
for kind, starts in {"press": (1.0,), "tap": (0.5, 1.5, 2.5, 3.5), "rub": (0.8, 1.8, 2.8)}.items():
    (skin / kind).mkdir(parents=True)
    for number in range(6):
        width = {"press": 0.8, "tap": 0.1, "rub": 0.3}[kind]
        taxels = np.arange(16) * (0.05 if kind == "rub" else 0.0)
        touch = sum(np.exp(-(((stamps - start - taxels) / width) ** 2)) for start in starts)
        counts = 9000 + generator.uniform(2500, 3500, 16) * touch + generator.normal(0, 4, touch.shape)
        lines = [
            ",".join([f"{s:.4f}", *map(str, row)]) for s, row in zip(stamps[:, 0], counts.astype(int), strict=True)
        ]
        header = ",".join(["time", *(f"s{taxel}" for taxel in range(16))])
        (skin / kind / f"{number}.csv").write_text("\n".join([header, *lines]) + "\n")

# %% [markdown]
# Two commands lead from there to classes and through the RTL: `make train DATA=my_skin/` and
# `make sim DATA=my_skin/`. Time stamps, rate, baseline, scale and clock are found; warnings name the option that
# mends what they warn of.


# %%
def run(*words):
    environment = os.environ | {"PYTHONPATH": os.getcwd()}
    command = [sys.executable, "-m", "eskin", *words]
    return subprocess.run(command, cwd=skin.parent, env=environment, capture_output=True, text=True, check=True)


trained = run("train", "--data", "my_skin", "--epochs", "40", "--set", "hidden=64")
print("\n".join(trained.stdout.splitlines()[-3:]))
played = run("sim", "--data", "my_skin", "--encoding", "lcs", "--sim", "icarus", "--ticks", "60")
print(played.stdout)

# %% [markdown]
# ## Where to go on
#
# - Your own recordings: all that is found and can be said, `make replay`, `make predict`, `make study`,
#   [Your own recordings](guide/recordings.md).
# - Verilog for your flow: `make verilog ROWS=12 COLUMNS=16`, [Verilog](guide/verilog.md).
# - A whole dataset through the RTL, and its spikes through a trained network: `make replay`, `make train`,
#   `make predict`, [Classifier](guide/classifier.md).
# - What it all costs in power: [Power](guide/power.md).
