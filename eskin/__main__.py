"""Run the command ``eskin`` by ``python -m eskin``."""

from eskin.app.__main__ import main

main()
