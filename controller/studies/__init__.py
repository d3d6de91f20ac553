"""Questions that take many trials to answer: landscapes and comparisons."""
