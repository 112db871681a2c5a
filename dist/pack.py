#!/usr/bin/env python3
"""Packs a folder so that the same files give the same bytes: sorted, with one time, owner and mode.

    pack.py FOLDER OUT SECONDS      FOLDER.tar.gz, or FOLDER.zip for Windows, in OUT
"""

import gzip
import io
import pathlib
import sys
import tarfile
import time
import zipfile


def mode(path: pathlib.Path) -> int:
    return 0o755 if path.name in ("study", "study.exe") or path.suffix in (".sh", ".py") else 0o644


def main() -> None:
    folder, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    seconds = int(sys.argv[3])
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    if "windows" in folder.name:
        with zipfile.ZipFile(out / f"{folder.name}.zip", "w", zipfile.ZIP_DEFLATED) as archive:
            for path in files:
                name = path.relative_to(folder.parent).as_posix()
                entry = zipfile.ZipInfo(name, time.gmtime(seconds)[:6])
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.create_system = 3
                entry.external_attr = (0o100000 | mode(path)) << 16
                archive.writestr(entry, path.read_bytes())
        return
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        for path in files:
            entry = tarfile.TarInfo(path.relative_to(folder.parent).as_posix())
            content = path.read_bytes()
            entry.size, entry.mtime, entry.mode = len(content), seconds, mode(path)
            archive.addfile(entry, io.BytesIO(content))
    with open(out / f"{folder.name}.tar.gz", "wb") as file:
        # Without the name and the time that gzip writes otherwise.
        with gzip.GzipFile(filename="", mode="wb", fileobj=file, mtime=0, compresslevel=9) as zipped:
            zipped.write(buffer.getvalue())


main()
