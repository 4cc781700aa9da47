"""The parts of tools/bench.py: scenes, what is measured, the figures, the report and its plots."""
