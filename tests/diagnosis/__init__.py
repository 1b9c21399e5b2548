"""The diagnosis: data faults, causes, extension, gain, verdict."""
