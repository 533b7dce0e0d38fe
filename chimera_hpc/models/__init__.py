"""Models of coupled oscillators, one small file each, with their own tables of parameters."""
