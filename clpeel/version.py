"""The version, for the package, the build and the cache of compiled kernels."""

VERSION = "0.2.0"
