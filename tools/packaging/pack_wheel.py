#!/usr/bin/env python3
"""Packs a folder, which bundle.sh has filled, as a wheel: pack_wheel.py FOLDER VERSION OUT_FOLDER [COMPRESSION_LEVEL]

The module is of one version of Python (pybind11 does not know the stable ABI), which its name tells; the C library is that of the machine.
"""

import base64
import hashlib
import os
import pathlib
import re
import sys
import zipfile

folder, version, out = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3])
level = int(sys.argv[4]) if len(sys.argv) > 4 else 9
(module,) = (folder / "curvisplat").glob("_core.*.so")
python = "cp" + re.fullmatch(r"_core\.cpython-(\d+)-x86_64-linux-gnu\.so", module.name)[1]
libc = os.confstr("CS_GNU_LIBC_VERSION").split()[1].replace(".", "_")
tag = f"{python}-{python}-manylinux_{libc}_x86_64"

info = f"curvisplat-{version}.dist-info"
summary = re.search('description = "(.+)"', (pathlib.Path(__file__).parent.parent / "python/pyproject.toml").read_text())[1]
texts = {
    f"{info}/METADATA": f"Metadata-Version: 2.1\nName: curvisplat\nVersion: {version}\nSummary: {summary}\n"
                        "License: Apache-2.0\nRequires-Dist: numpy\n",
    f"{info}/WHEEL": f"Wheel-Version: 1.0\nGenerator: curvisplat\nRoot-Is-Purelib: false\nTag: {tag}\n",
    # The program in PATH; pip names its own interpreter in the first line.
    f"curvisplat-{version}.data/scripts/curvisplat": "#!python\nimport importlib.util\nimport os\nimport sys\n\n"
        'package = os.path.dirname(importlib.util.find_spec("curvisplat").origin)\n'
        'os.execv(os.path.join(package, "curvisplat"), sys.argv)\n',
}
contents = [(name, text.encode(), 0o755 if "scripts" in name else 0o644) for name, text in texts.items()]
for file in sorted(folder.rglob("*")):
    if file.is_file() and "__pycache__" not in file.parts:
        name = str(file.relative_to(folder)).replace("licences/", f"{info}/licenses/", 1)
        contents.append((name, file.read_bytes(), 0o755 if os.access(file, os.X_OK) else 0o644))

record = ""
with zipfile.ZipFile(out / f"curvisplat-{version}-{tag}.whl", "w", zipfile.ZIP_DEFLATED, compresslevel=level) as wheel:
    def write(name, data, mode):
        entry = zipfile.ZipInfo(name)  # of 1980: the same parts make the same wheel
        entry.external_attr, entry.compress_type = (0o100000 | mode) << 16, zipfile.ZIP_DEFLATED
        wheel.writestr(entry, data)

    for name, data, mode in contents:
        write(name, data, mode)
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        record += f"{name},sha256={digest},{len(data)}\n"
    write(f"{info}/RECORD", (record + f"{info}/RECORD,,\n").encode(), 0o644)
print(f"{os.path.getsize(wheel.filename) >> 20} MB: {wheel.filename}")
