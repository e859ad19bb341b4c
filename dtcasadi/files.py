"""Files that appear whole or not at all."""

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def written(target: Path) -> Iterator[BinaryIO]:
    """A binary file beside the target that takes its place when the block ends without error.

    Raises:
        OSError: the folder is missing, read-only or full; nothing of the attempt stays behind.
    """
    target = Path(target)
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
    # Part of the name only, which may be as long as a file's name can be.
    temporary = target.with_name(f".{target.name[:40]}.{secrets.token_hex(8)}")
    # Not mkstemp, which is private to the user: a result has the permissions of any new file.
    try:
        opened = open(temporary, "xb")
    except OSError as error:
        raise type(error)(error.errno, error.strerror, str(target)) from error
    with opened as file:
        try:
            yield file
            file.close()
            os.replace(temporary, target)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
