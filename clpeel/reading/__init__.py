"""Reading: the files of strangers to scenes. Nothing here knows a device."""
