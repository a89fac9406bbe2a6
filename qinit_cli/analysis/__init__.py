"""Statistics of sources, fits and runs: pure functions over arrays, without files, commands or drawing."""
