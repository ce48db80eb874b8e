"""The maps: one small file for each case, its scene family, quantity, overlay and reference."""
