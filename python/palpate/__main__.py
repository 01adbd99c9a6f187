"""Where `palpate` and `python -m palpate` begin: Ctrl-C ends them without a word until a command has begun."""

from __future__ import annotations

import signal


def main() -> None:
    """Run the command line and exit with its code."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not if it is ignored, as under nohup
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from palpate.cli.main import main as run

    run()


if __name__ == "__main__":
    main()
