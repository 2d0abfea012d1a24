"""``python -m pathcontrol`` is the command ``pathcontrol``."""

from pathcontrol.cli import main

main(prog_name="pathcontrol")
