"""Files with damaged content."""


def damaged(tmp_path, data):
    """Write a log of these bytes."""
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    return path
