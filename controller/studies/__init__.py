"""Questions asked of many trials at once: landscapes and comparisons."""
