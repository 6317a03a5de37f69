# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Tutorial: from a sine to the class of a texture
#
# This tutorial takes a quarter of an hour and shows the result of every step. First, one taxel samples a sine. A
# decoder rebuilds the sine from the taxel's events, and a simulation of the hardware sends the same events. Then 64
# taxels slide over brick, grass and gravel, and a network classifies the textures. The last part does the same with
# recordings of a real finger, up to the class that the hardware computes.
#
# After `make setup`, run `docs/tutorial.py` in the repository root with `.venv/bin/python`, as a whole or cell by cell.
# This page and a notebook are generated from that file.

# %% [markdown]
# ## One sine, and its events
#
# `ReadoutConfig` holds every parameter of a readout. Here one taxel samples a signal at 20 kHz with 12 bits. A sample
# is an integer *code*. At a resolution of 4 bits an LSB is 2^-4 of full scale. The step of the encoder is half an LSB,
# which is 64 codes.

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
# The encoder compares the signal with a stored level, the *reference*. When the signal is one step above the reference,
# the taxel sends an ON event and the reference rises by one step. When the signal is one step below, the taxel sends an
# OFF event and the reference falls. So events are dense where the sine is steep, and absent at its peaks.

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
# The decoder rebuilds the reference exactly from the events. The reference stays within one step of the signal, unless
# the signal is too steep. `error_bound` returns the guaranteed limits of the difference.

# %%
from eskin.base.figures.style import OFF_COLOUR, ON_COLOUR, PALETTE

rebuilt = decode(config, counts, late)[:, 0]
low, high = error_bound(config)
error = signal - rebuilt
print(f"error from {error.min():.0f} to {error.max():.0f} codes; promised from {low:.0f} to {high:.0f}")

figure, (above, below) = plt.subplots(2, 1, figsize=(8, 4.5), sharex=True, height_ratios=[3, 1], layout="constrained")
above.plot(seconds * 1e3, signal / config.full_scale, color=PALETTE["grey"], label="signal")
above.step(
    seconds * 1e3, rebuilt / config.full_scale, where="post", color="black", lw=1, label="rebuilt from the events"
)
for on, colour in ((True, ON_COLOUR), (False, OFF_COLOUR)):
    times = events["t"][events["p"] == on] / config.clock_hz * 1e3
    above.plot(times, np.full(len(times), -1.0), "|", color=colour, label="ON" if on else "OFF")
figure.legend(loc="outside upper left", ncols=4, fontsize="small", frameon=False)
above.set(ylabel="signal (full scales)")
below.plot(seconds * 1e3, error, color="black", lw=1)
for bound in (low, high):
    below.axhline(bound, color=PALETTE["vermilion"], lw=0.8, ls="--")
_ = below.set(xlabel="time (ms)", ylabel="error (codes)")

# %% [markdown]
# To use another encoder, change one word of the configuration. CW-LCS closes its window while the taxel sends no event,
# as at the peaks of the sine, and therefore detects smaller changes. N-LCS has one comparator with a leaking threshold,
# like a leaky neuron, and sends no OFF events. Bipolar N-LCS sends both. [Encoders](reference/encoders.md) describes
# the rules.

# %%
from eskin.model.encoders import registry

for encoding in registry.NAMES:
    other = config.replace(encoding=encoding, window_period=4)
    print(f"{encoding:12} {np.abs(encode_timed(other, samples)[0]).sum():4} events")

# %% [markdown]
# ## Clock by clock
#
# So far the taxel did not share its link. `simulate` models the whole readout clock by clock, with arbiter and link.
# The first event leaves three clocks after its sample. For a single taxel, `simulate` returns the events of the cells
# above. Four taxels that sample the same sine must share the link and wait for each other.

# %%
from eskin.model.readout import Stimulus, simulate

stimulus = Stimulus.from_samples(config, samples)
model_events = simulate(config, stimulus)
assert np.array_equal(model_events, events)
four = config.replace(columns=4)
print(simulate(four, Stimulus.from_samples(four, samples.repeat(4, axis=1)))[:5])

# %% [markdown]
# ## The same signal through the RTL
#
# The hardware is written in Amaranth, which includes a simulator. The next cell plays the samples into
# `eskin_readout` and records three ports in every clock. An event is transferred when `event_valid` and `event_ready`
# are both high.

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
# The plot shows the clocks around the first event. The readout takes a sample while `sample_valid` is high. Then the
# taxel decides and the arbiter grants. `event_valid` rises in the third clock after the sample.
# [Microarchitecture](design/microarchitecture.md) has the full timing table.

# %%
first = event_clocks[0][0]
window = np.arange(first - 6, first + 6)
figure, axes = plt.subplots(3, 1, figsize=(8, 2.4), sharex=True, layout="constrained")
for axis, name, column in zip(axes, ("sample_valid", "event_valid", "event_polarity"), range(3), strict=True):
    axis.step(window, np.array(trace)[window, column], where="post", color=PALETTE["blue"])
    axis.set(ylim=(-0.2, 1.2), yticks=[])
    axis.set_ylabel(name, rotation=0, ha="right", va="center", family="monospace")
    axis.spines[["top", "right", "left"]].set_visible(False)
_ = axes[-1].set(xlabel="clock", xticks=window)

# %% [markdown]
# So far we used Amaranth's simulator. `make sim` compares the delivered Verilog with the model, in Icarus or
# Verilator and over many stimuli. With `--waves` the next cell also writes a waveform for GTKWave:

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
# ## The class of a texture
#
# Now 8 x 8 taxels slide over photographs of brick, grass and gravel at 65 mm/s. `record` passes one image through scan,
# sensor model and readout.

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
    recording.events["t"] / array.clock_hz * 1e3, taxel, s=0.2, c=np.where(recording.events["p"], ON_COLOUR, OFF_COLOUR)
)
_ = raster.set(xlabel="time (ms)", ylabel="taxel", title="address events, ON blue, OFF orange")

# %% [markdown]
# The network reads the number of events in each time bin of 2 ms, not single events. The network has 128 input
# channels, one for each taxel and polarity. We record all 48 images, train on 36 and test on 12. The hidden neurons
# leak, and the outputs do not fire. Twenty epochs take seconds and show that the network learns.
# [Classifier](guide/classifier.md) describes full trainings with six textures and a test protocol.

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
# How much of a scan does the network need? The next cell gives the network the first bins of one test image, then more
# and more of them:

# %%
import torch

number = test[0]
counts = data.batch([number])
with torch.no_grad():
    heard = [training.network.eval()(counts[: bins + 1]).logits.softmax(1)[0] for bins in range(data.steps)]
figure, axis = plt.subplots(figsize=(8, 2.4), layout="constrained")
for name, evidence, line in zip(data.class_names, torch.stack(heard).T, ("-", "--", ":"), strict=True):
    axis.plot(np.arange(data.steps) * data.step_s * 1e3, evidence, line, color="black", label=name)
figure.legend(loc="outside upper right", ncols=3, fontsize="small", frameon=False)
axis.set_title(data.names[number], loc="left")
_ = axis.set(xlabel="time (ms)", ylabel="SoftMax (0 to 1)", ylim=(-0.05, 1.05))

# %% [markdown]
# ## A real finger
#
# The textures above are photographs. The project also has 24 recordings of a real tactile finger with 16 capacitive
# taxels, which slides over four fabrics ([source and results](results/finger.md)). Each fabric has a folder, and each
# recording is a `.csv` file with one line per sample. For your own sensor, replace `finger` by your folder.
#
# `read_set` finds time stamps, taxel columns and sampling rate, subtracts the first value of each taxel, and scales all
# recordings equally. The next cell shows the signals and events of one recording.

# %%
from eskin.skin.recordings.folder import read_set
from eskin.skin.recordings.options import FINGER, Preparation

finger = read_set(FINGER, Preparation(baseline="first"), ReadoutConfig(resolution=4))
names = [source.name for source in finger.sources]
number = names.index("Denim/F180_V-150mmps_0")
recording, _ = finger.recording(number)
print(f"{len(names)} recordings, {finger.config.taxels} taxels at {finger.config.sample_rate_hz:g} samples/s")
print(f"{names[number]}: {len(recording.events)} events in {recording.duration_s:.1f} s")

figure, (above, below) = plt.subplots(2, 1, figsize=(8, 4), sharex=True, layout="constrained")
signals = finger.codes[number] / finger.config.full_scale
above.plot(np.arange(len(signals)) / finger.config.sample_rate_hz, signals, color="black", alpha=0.4, lw=0.7)
above.set(ylabel="16 taxels (full scales)", title=names[number])
events = recording.events
taxel = events["y"] * finger.config.columns + events["x"]
colours = np.where(events["p"], ON_COLOUR, OFF_COLOUR)
below.scatter(events["t"] / finger.config.clock_hz, taxel, s=2, c=colours)
_ = below.set(xlabel="time (s)", ylabel="taxel", title="address events, ON blue, OFF orange")

# %% [markdown]
# Four commands lead from the folder to a class that the RTL computes. `train` chooses encoder, resolution and time
# constants for the recordings. Four recordings are not used for training. `sim` compares RTL and model on three
# recordings, `quantise` rounds the network to integers, and `touch` sends the test recordings through readout and
# classifier in RTL.


# %%
from pathlib import Path

work = Path(tempfile.mkdtemp())


def run(*words):
    command = [sys.executable, "-m", "eskin", *words]
    return subprocess.run(command, cwd=work, capture_output=True, text=True, check=True).stdout.splitlines()


print("\n".join(run("train", "--data", "finger")[-8:]))
print("\n".join(run("sim", "--data", "finger", "--encoding", "lcs", "--ticks", "60")[-1:]))
print("\n".join(run("quantise")[-1:]))
print("\n".join(run("touch", "--data", "finger")))

# %% [markdown]
# ## Next steps
#
# - See all options for recordings, and use `make replay`, `make predict` and `make study` with recordings:
#   [Your own recordings](guide/recordings.md).
# - Get Verilog for your flow with `make verilog ROWS=12 COLUMNS=16`: [Verilog](guide/verilog.md).
# - Play a whole dataset through the RTL and classify its spikes with `make replay`, `make train`, `make predict`:
#   [Classifier](guide/classifier.md).
# - Compare the power of the readouts: [Power](guide/power.md).
