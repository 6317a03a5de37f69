"""``python -m snn``: train the classifier, and cross-validate it.

torch and the models are imported only inside functions, so that ``--help`` and errors come at once.
"""

from __future__ import annotations

from model.cli import make_app, run
from snn.commands import crossval, train

app = make_app("Classifier of the spiking e-skin readout: from address events to texture class.")

for command in (train, crossval):
    app.command()(command)


def main() -> None:
    """Run the command line of the classifier."""
    run(app, "python -m snn")


if __name__ == "__main__":
    main()
