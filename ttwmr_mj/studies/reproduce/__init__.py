"""The article, figure by figure and claim by claim, re-run and judged: `ttwmr reproduce`."""
