"""The parts of tools/bench.py: scenes, measurements, figures, the report and its plots."""
