"""One function per figure: arrays in, matplotlib Figure out; nothing is written."""
