"""Scenes: what goes in. NumPy alone; nothing here knows a device."""
