"""One page about one run or several: animation, figures, numbers, settings, and how to make it again."""
