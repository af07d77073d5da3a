"""Writes Zarr stores by the specifications of versions 2 and 3, for the tests: chunks, codecs, shards, archives."""
import ctypes
import ctypes.util
import gzip
import itertools
import json
import math
import shutil
import struct
import subprocess
import zipfile
import zlib

import numpy as np


def blosc(data, item, name="lz4", shuffle=1):
    library = ctypes.CDLL(ctypes.util.find_library("blosc"))
    out = ctypes.create_string_buffer(len(data) + 64)
    size = library.blosc_compress_ctx(5, shuffle, ctypes.c_size_t(item), ctypes.c_size_t(len(data)), data, out,
                                      ctypes.c_size_t(len(out)), name.encode(), ctypes.c_size_t(0), 1)
    return out.raw[:size]


def zstd(data):
    return subprocess.run(["zstd", "--stdout", "--quiet"], input=data, capture_output=True, check=True).stdout


def lz4(data):
    library = ctypes.CDLL(ctypes.util.find_library("lz4"))
    out = ctypes.create_string_buffer(len(data) + len(data) // 200 + 64)
    size = library.LZ4_compress_default(data, out, len(data), len(out))
    return struct.pack("<I", len(data)) + out.raw[:size]


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return data + struct.pack("<I", crc ^ 0xFFFFFFFF)


def shuffled(data, item):
    return np.frombuffer(data, "u1").reshape(-1, item).T.tobytes()


def encode(data, codec, item):
    numbers = lambda: np.frombuffer(data, f"<i{item}")
    return {"bitround": lambda: data, "quantize": lambda: data, "delta": lambda: np.diff(numbers(), prepend=numbers().dtype.type(0)).tobytes(),
            "fixedscaleoffset": lambda: ((numbers() - 5.0) * 2).astype("<i4").tobytes(),
            "crc32": lambda: struct.pack("<I", zlib.crc32(data)) + data, "adler32": lambda: struct.pack("<I", zlib.adler32(data)) + data,
            None: lambda: data, "zlib": lambda: zlib.compress(data), "gzip": lambda: gzip.compress(data), "zstd": lambda: zstd(data),
            "lz4": lambda: lz4(data), "blosc": lambda: blosc(data, item), "blosc-zstd": lambda: blosc(data, item, "zstd", 2),
            "shuffle": lambda: shuffled(data, item), "crc32c": lambda: crc32c(data)}[codec]()


def configuration(codec, item):
    if codec.startswith("blosc"):
        return {"cname": codec[6:] or "lz4", "clevel": 5, "shuffle": "shuffle", "typesize": item, "blocksize": 0}
    filters = {"bitround": {"keepbits": 10}, "quantize": {"digits": 3, "dtype": f"<f{item}"}, "delta": {"dtype": f"<i{item}"},
               "fixedscaleoffset": {"scale": 2, "offset": 5, "dtype": f"<i{item}", "astype": "<i4"}}
    if codec in filters:
        return filters[codec]
    return {"elementsize": item} if codec == "shuffle" else {"level": 1} if codec in ("gzip", "zstd") else {}


def parts(values, chunks):
    """The chunks of an array, those at its ends filled up."""
    grid = [math.ceil(length / chunk) for length, chunk in zip(values.shape, chunks)]
    for at in itertools.product(*map(range, grid)):
        chunk = np.zeros(chunks, values.dtype)
        some = values[tuple(slice(a * c, (a + 1) * c) for a, c in zip(at, chunks))]
        chunk[tuple(map(slice, some.shape))] = some
        yield at, chunk


class Store:
    def __init__(self, path, version, attributes=None):
        self.path, self.version = path, version
        if version == 2:
            self.write(".zgroup", json.dumps({"zarr_format": 2}))
            self.write(".zattrs", json.dumps(attributes or {}))
        else:
            self.write("zarr.json", json.dumps({"zarr_format": 3, "node_type": "group", "attributes": attributes or {}}))

    def write(self, key, data):
        file = self.path / key
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data if isinstance(data, bytes) else data.encode())

    def add(self, name, dimensions, values, **options):
        (self.add2 if self.version == 2 else self.add3)(name, dimensions.split(), np.asarray(values), **options)

    def add2(self, name, dimensions, values, **options):
        """Options: chunks, codecs, fill, order, separator, kind, missing (chunks that are not written); others are attributes."""
        take = lambda key, otherwise: options.pop(key, otherwise)
        values = values.astype(take("kind", values.dtype))
        chunks, item, codecs = take("chunks", values.shape), values.dtype.itemsize, take("codecs", (None,))
        fill, order, separator, missing = take("fill", None), take("order", "C"), take("separator", "."), take("missing", ())
        ids = [dict(id=codec.split("-")[0], **configuration(codec, item)) for codec in codecs if codec]
        for one in ids:
            if one["id"] == "blosc":
                one["shuffle"] = 1
        self.write(f"{name}/.zarray", json.dumps({
            "zarr_format": 2, "shape": values.shape, "chunks": chunks, "dtype": values.dtype.str, "fill_value": fill, "order": order,
            "dimension_separator": separator, "filters": ids[:-1] or None, "compressor": ids[-1] if ids else None}))
        self.write(f"{name}/.zattrs", json.dumps({"_ARRAY_DIMENSIONS": dimensions, **options}))
        for at, chunk in parts(values, chunks):
            if at in missing:
                continue
            data = chunk.tobytes(order)
            for codec in codecs:
                data = encode(data, codec, item)
            self.write(f"{name}/{separator.join(map(str, at)) or 0}", data)

    def add3(self, name, dimensions, values, **options):
        """Options as of add2(), and shards, index (where it is in the shard), key (the encoding of chunks' names)."""
        take = lambda word, otherwise: options.pop(word, otherwise)
        values = values.astype(take("kind", values.dtype))
        chunks, item, codecs = take("chunks", values.shape), values.dtype.itemsize, take("codecs", (None,))
        fill, order, missing = take("fill", 0), take("order", tuple(range(values.ndim))), take("missing", ())
        shards, index, key = take("shards", None), take("index", "end"), take("key", "default")
        big = values.dtype.byteorder == ">"
        chain = [{"name": "bytes", "configuration": {"endian": "big" if big else "little"}}]
        if order != tuple(range(values.ndim)):
            chain.insert(0, {"name": "transpose", "configuration": {"order": order}})
        chain += [{"name": codec.split("-")[0], "configuration": configuration(codec, item)} for codec in codecs if codec]

        def encoded(chunk):
            data = chunk.transpose(order).tobytes()
            for codec in codecs:
                data = encode(data, codec, item)
            return data

        if shards:
            chain = [{"name": "sharding_indexed", "configuration": {
                "chunk_shape": chunks, "codecs": chain, "index_location": index,
                "index_codecs": [{"name": "bytes", "configuration": {"endian": "little"}}, {"name": "crc32c"}]}}]
        self.write(f"{name}/zarr.json", json.dumps({
            "zarr_format": 3, "node_type": "array", "shape": values.shape, "data_type": values.dtype.name, "codecs": chain,
            "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": shards or chunks}},
            "chunk_key_encoding": {"name": key, "configuration": {"separator": "/" if key == "default" else "."}},
            "fill_value": fill, "dimension_names": dimensions, "attributes": options}))
        for at, chunk in parts(values, shards or chunks):
            if at in missing:
                continue
            data = self.shard(chunk, chunks, encoded, index) if shards else encoded(chunk)
            self.write(f"{name}/{'/'.join(['c', *map(str, at)]) if key == 'default' else '.'.join(map(str, at)) or 0}", data)

    @staticmethod
    def shard(values, chunks, encoded, index):
        """Chunks of zeros alone are left out."""
        entries, body = [], b""
        begin = 0 if index == "end" else 16 * math.prod(v // c for v, c in zip(values.shape, chunks)) + 4
        for _, chunk in parts(values, chunks):
            if not chunk.any():
                entries += [2**64 - 1] * 2
                continue
            data = encoded(chunk)
            entries += [begin + len(body), len(data)]
            body += data
        table = crc32c(struct.pack(f"<{len(entries)}Q", *entries))
        return body + table if index == "end" else table + body

    def zip(self, compression=zipfile.ZIP_STORED):
        """The store as an archive, in the place of its folder."""
        archive = self.path.with_suffix(".zarr.zip")
        with zipfile.ZipFile(archive, "w", compression) as to:
            for file in sorted(self.path.rglob("*")):
                if file.is_file():
                    to.write(file, file.relative_to(self.path))
        shutil.rmtree(self.path)
        return archive
