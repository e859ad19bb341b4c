"""Versions of what is installed."""

from importlib import metadata


def version_of(package: str) -> str | None:
    """The version of an installed package; None where it is run from its sources or missing."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None
