"""The command cache: recorded scans (docs/guide/classifier.md)."""

from eskin.app.options import command, opt


@command("Classifier", fuzz="")
def cache(clear: bool = opt(False, "--clear", "remove all recorded scans")) -> None:
    """Print the number of cached scans and their folder, or remove them with --clear."""
    from eskin.base import cache as place
    from eskin.snn.data import cache as scans

    if clear:
        print(f"removed {scans.clear()} recorded scans from {place.folder()}")
        return
    entries, size = scans.size()
    print(
        f"{place.folder()}: {entries} recorded scans, {size / 1e6:.1f} MB of at most {scans.LIMIT_BYTES / 1e6:.0f} MB"
    )
    if place.usable("scans") is None:
        print("the folder is not used: it cannot be written, or other users own it or can write to it")
