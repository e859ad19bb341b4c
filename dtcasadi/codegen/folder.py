"""The target folder: what is there, whose it is, and how new files take their places.

`export.json` is the manifest: what was exported, and the SHA-256 of each file as written. A file
that the manifest does not know in its present state is foreign, or was edited.
"""

import hashlib
import json
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import ModelError
from ..files import written
from .description import Export

MANIFEST = "export.json"
SCHEMA = 1


@dataclass(frozen=True)
class Exported:
    """What `export_c` wrote.

    Attributes:
        folder: the target folder.
        name: prefix of every symbol.
        files: paths of the files, in order.
        functions: for each function its name, inputs, outputs and the sizes of its work space.
        bytes: size of all files.
    """

    folder: Path
    name: str
    files: tuple[Path, ...]
    functions: tuple[Mapping[str, Any], ...]
    bytes: int


def write_folder(
    folder: Path,
    export: Export,
    files: Mapping[str, str],
    functions: tuple[Mapping[str, Any], ...] = (),
    *,
    force: bool = False,
) -> Exported:
    """Put texts into a folder, all of them after all of them could be written.

    Args:
        folder: created where missing.
        export: what is written.
        files: texts by file name.
        functions: of the result.
        force: overwrite foreign and edited files.

    Raises:
        ModelError: the folder holds files of other hands under these names.
        OSError: it cannot be created or written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    texts = {name: text.encode("utf-8") for name, text in files.items()}
    manifest = {
        "schema": SCHEMA,
        "name": export.name,
        "graph": export.graph,
        "files": {name: hashlib.sha256(data).hexdigest() for name, data in texts.items()},
    }
    # Renamed last, because first in: after an interruption the same export can be written again.
    texts = {MANIFEST: json.dumps(manifest, indent=1).encode() + b"\n", **texts}
    for name in texts:
        if Path(name).name != name:
            raise ModelError(f"file name: expected one inside the folder, got {name!r}")
    if not force:
        _refuse_foreign(folder, export.name, texts)
    with ExitStack() as stack:
        for name, data in texts.items():
            stack.enter_context(written(folder / name)).write(data)
    return Exported(
        folder,
        export.name,
        tuple(folder / name for name in (*files, MANIFEST)),
        functions,
        sum(map(len, texts.values())),
    )


def _refuse_foreign(folder: Path, name: str, texts: Mapping[str, bytes]) -> None:
    other, known = _manifest(folder)
    if other not in ("", name):
        raise ModelError(
            f"{folder}: holds the export {other!r}; choose another folder, or overwrite with force"
        )
    foreign = []
    for file, data in texts.items():
        path = folder / file
        if not (path.exists() or path.is_symlink()) or (file == MANIFEST and other):
            continue
        present = path.read_bytes() if path.is_file() else b""
        if present != data and hashlib.sha256(present).hexdigest() != known.get(file):
            foreign.append(file)
    if foreign:
        raise ModelError(
            f"{folder}: {', '.join(foreign)}: not written by this package, or edited since; choose "
            "another folder, or overwrite with force"
        )


def _manifest(folder: Path) -> tuple[str, Mapping[str, str]]:
    """Name of an earlier export, "" without one, and SHA-256 by file name as it wrote them."""
    try:
        found = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        if isinstance(found["files"], dict) and isinstance(found["graph"], str):
            return str(found["name"]), found["files"]
    except (OSError, ValueError, KeyError, TypeError):
        pass
    return "", {}
