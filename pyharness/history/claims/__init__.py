"""The statements of the thesis, judged."""
