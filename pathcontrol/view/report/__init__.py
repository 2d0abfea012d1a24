"""The report: one page about one run or several, with animation, figures, numbers, settings, and reproduction."""
