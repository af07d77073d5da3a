"""Faces of the grid that a splat cache has (faces.bin), by stream/FORMAT.md."""
import struct

import numpy as np
from cache_streams import Contents, need


class Faces:
    """faces.bin of an open cache: faces, patches, regions, and the nodes of a patch."""
    def __init__(self, cache):
        self.cache, self.file = cache, cache.load("faces.bin")
        magic, version, v, *counts, _, table = struct.unpack_from("<8s6IQ", self.file)
        need((magic, version) == (b"CVSfaces", 1), "header of faces.bin")
        cache.verify("faces.bin", self.file[:88] + self.file[table:])
        self.box = np.array(struct.unpack_from("<6d", self.file, 40)).reshape(2, 3)
        sizes = [4 * v, *(count * size for count, size in zip(counts, (40, 112, 136)))]
        need(table + sum(sizes) == len(self.file), "size of the table of faces.bin")
        ends = np.cumsum([table, *sizes]).tolist()
        parts = [self.file[begin:end] for begin, end in zip(ends, ends[1:])]
        self.variables = np.frombuffer(parts[0], "<u4").tolist()
        self.faces = [dict(block=f[0], axis=f[1], side=f[2], index=f[4], nodes=f[5:7], root=f[7])
                      for f in struct.iter_unpack("<IBBHQQQII", parts[1])]
        self.patches = [dict(face=f[0], stride=f[1:3], nodes=f[3:5], first=f[5:7], children=f[7:9], error=f[9],
                             extent=(f[11], f[10], f[12]), box=f[13:19])
                        for f in struct.iter_unpack("<III2H2QIIfIQQ6d", parts[2])]
        self.regions = [dict(face=f[0], first=f[2:4], last=f[4:6], name=f[6].rstrip(b"\0").decode(),
                             type=f[7].rstrip(b"\0").decode()) for f in struct.iter_unpack("<II4Q64s32s", parts[3])]

    def lattice(self, n):
        """The nodes of the face that a patch has, along u and v."""
        patch = self.patches[n]
        return [np.minimum(f + s * np.arange(count), last - 1) for f, s, count, last in
                zip(patch["first"], patch["stride"], patch["nodes"], self.faces[patch["face"]]["nodes"])]

    def patch(self, n):
        """Positions, which quads are drawn, and scalars."""
        data, (columns, rows) = self.cache.stream("faces.bin", self.patches[n]["extent"]), self.patches[n]["nodes"]
        u, v, scalars, *codes = struct.unpack_from("<HHI6B", data)
        need((u, v, scalars) == (columns, rows, len(self.variables)), "header of a patch")
        heads = [struct.unpack_from("<ffBB", data, 16 + 12 * s) for s in range(scalars)]
        quads = (columns - 1) * (rows - 1)
        frame, codes = data[16 + 12 * scalars:], [*zip(codes[::2], codes[1::2]), *(head[2:] for head in heads)]
        contents = Contents(frame, 0, codes, columns * rows, before=(quads + 7) // 8)
        drawn = np.unpackbits(np.frombuffer(contents.data, np.uint8, (quads + 7) // 8), bitorder="little")[:quads]
        contents.rows = [(row * columns, columns, (row - 1) * columns if row else None) for row in range(rows)]
        code = np.stack([contents.values() for _ in range(3)], axis=1).astype(np.float64)
        need(code.max() < 2 ** 26, "coordinate of a patch")
        values = [lower + (upper - lower) * contents.values().astype(np.float64) / 65535 for lower, upper, *_ in heads]
        return self.box[0] + self.box[1] * code, drawn, values
