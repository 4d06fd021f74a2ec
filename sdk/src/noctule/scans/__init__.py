"""The files that scanners of all kinds write, angle and distance, as surveys: what ``noctule import`` does.

lines -> rows -> readings -> passes -> sweeps
"""
