"""`python -m snakebench.cli` is `snakebench`."""

from snakebench.cli import main

main()
