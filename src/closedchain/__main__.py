"""``python -m closedchain``: the command line where no console script is on the path."""

from closedchain.cli import main

main()
