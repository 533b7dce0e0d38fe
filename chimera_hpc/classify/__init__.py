"""Trees, classes, modal classes, atlases, densities, basins, robustness: arrays in, arrays out."""
