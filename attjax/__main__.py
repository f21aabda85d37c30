"""``python -m attjax``: the same as the installed command ``attjax``."""

import sys

from attjax.commands import main

if __name__ == "__main__":
    sys.exit(main())
