# SPDX-License-Identifier: GPL-3.0-or-later
"""A wheel with a full RECORD, so that whoever unpacks it can remove every file again."""

import base64
import hashlib
import zipfile

TIMESTAMP = (2020, 1, 1, 0, 0, 0)  # archives of the same content are the same bytes


def entry(name, executable=False, method=zipfile.ZIP_DEFLATED):
    info = zipfile.ZipInfo(name, TIMESTAMP)
    info.external_attr = (0o100755 if executable else 0o100644) << 16
    info.compress_type = method
    return info


def write_wheel(folder, name, version, tag, files, licence):
    """Writes `<name>-<version>-<tag>.whl` into `folder`; `files` maps archive names to paths. Its path."""
    path = folder / f"{name}-{version}-{tag}.whl"
    info = f"{name}-{version}.dist-info"
    metadata = (
        f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\nLicense: GPL-3.0-or-later\n"
        "Summary: As-rigid-as-possible deformation of implicit surfaces, with its libraries\n"
    )
    wheel = f"Wheel-Version: 1.0\nGenerator: arapfields\nRoot-Is-Purelib: false\nTag: {tag}\n"
    texts = {
        f"{info}/METADATA": metadata.encode(),
        f"{info}/WHEEL": wheel.encode(),
        f"{info}/licenses/LICENSE": licence.encode(),
    }
    record = []
    partial = path.with_suffix(".partial")
    with zipfile.ZipFile(partial, "w", compresslevel=9) as archive:
        contents = [(target, source.read_bytes) for target, source in sorted(files.items())]
        contents += [(target, lambda text=text: text) for target, text in texts.items()]
        for target, read in contents:
            data = read()
            archive.writestr(entry(target, executable=".so" in target or target.endswith(".dylib")), data)
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            record.append(f"{target},sha256={digest},{len(data)}")
        record.append(f"{info}/RECORD,,")
        archive.writestr(entry(f"{info}/RECORD"), "\n".join(record) + "\n")
    partial.replace(path)
    return path
