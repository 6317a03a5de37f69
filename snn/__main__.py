"""``python -m snn``: train the classifier, cross-validate, sweep, predict, draw, exchange.

torch and the models are imported only inside functions, so that ``--help`` and errors come at once.
"""

from __future__ import annotations

from model.cli.app import make_app, run
from snn.commands.cache import cache
from snn.commands.counts import counts
from snn.commands.exchange import convert, export, import_, quantise
from snn.commands.figures import fig8, fig9
from snn.commands.pair import pair
from snn.commands.predict import predict
from snn.commands.robustness import robustness
from snn.commands.studies import merits, noise_power, precision
from snn.commands.sweep import sweep
from snn.commands.train import crossval, train

app = make_app("Classifier of the spiking e-skin readout: from address events to texture class.")

COMMANDS = (
    train,
    crossval,
    sweep,
    pair,
    counts,
    predict,
    robustness,
    noise_power,
    merits,
    precision,
    fig8,
    fig9,
    export,
    convert,
    quantise,
    cache,
)
for command in COMMANDS:
    app.command()(command)
app.command("import")(import_)


def main() -> None:
    """Run the command line of the classifier."""
    run(app, "python -m snn")


if __name__ == "__main__":
    main()
