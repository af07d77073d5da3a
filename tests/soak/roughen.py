#!/usr/bin/env python3
"""Makes what `curvisplat generate` wrote hard to compress: random bits into its coordinates and values.

    roughen.py FILE HEADER_BYTES BITS     the lowest BITS of every 4-byte float's mantissa, at most 23

In place, by pieces, always the same bits for the same file.
"""
import random
import sys

PIECE_BYTES = 1 << 24


def mask(bits):
    """Of a little-endian float's four bytes."""
    return [(1 << max(0, min(8, bits - 8 * byte))) - 1 for byte in range(4)]


def noise(source, count, bits):
    result = bytearray(4 * count)
    for byte, keep in enumerate(mask(bits)):
        if keep:
            table = bytes(value & keep for value in range(256))
            result[byte::4] = source.randbytes(count).translate(table)
    return result


def main():
    name, header, bits = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    source = random.Random(bits)
    with open(name, "r+b") as file:
        file.seek(header)
        while True:
            start = file.tell()
            piece = file.read(PIECE_BYTES)
            if not piece:
                break
            count = len(piece) // 4
            rough = int.from_bytes(piece, "little") ^ int.from_bytes(noise(source, count, bits), "little")
            file.seek(start)
            file.write(rough.to_bytes(len(piece), "little"))


if __name__ == "__main__":
    main()
