"""Pictures: what comes out, as arrays and as files. Nothing here knows a device."""
