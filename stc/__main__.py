"""``python -m stc`` is the command ``stc``."""

from stc.cli import main

main()
