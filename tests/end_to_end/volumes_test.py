#!/usr/bin/python3
"""volumes_test.py CURVISPLAT

The volume that `info` and a cache's manifest (the sum of the splats' weights) state of O-meshes whose cells grow up to fourfold from one
to the next, against the sum of the hexahedra's volumes. Exit status 77 (skipped) without python3-vtk9.
"""
import unittest

from structured_formats import Block, StructuredFormats, np


def volume(places):
    """places[axis, k, j, i]: of each cell six tetrahedra."""
    points = np.moveaxis(places, 0, -1)
    c = [points[k:k - 1 or None, j:j - 1 or None, i:i - 1 or None] for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    total = 0
    for a, b in ((1, 3), (3, 2), (2, 6), (6, 4), (4, 5), (5, 1)):
        total = total + np.einsum("...i,...i", c[a] - c[0], np.cross(c[b] - c[0], c[7] - c[0])) / 6
    return abs(total).sum()


class Volumes(StructuredFormats):
    def test_o_meshes(self):
        for around, outwards, growth in ((49, 33, 1.2), (25, 17, 2.0), (13, 7, 3.0), (13, 5, 4.0)):
            with self.subTest(growth=growth):
                angle = np.linspace(0, 2 * np.pi, around)
                angle[-1] = 0  # the last column is the first
                radius = np.cumsum(np.r_[1, 0.02 * growth ** np.arange(outwards - 1)])
                block = Block((4, outwards, around))
                k, j, i = np.meshgrid(np.linspace(0, 1, 4), radius, angle, indexing="ij")
                block.places = np.stack([j * np.cos(i), j * np.sin(i), k])
                path, exact = self.vtk_file([block]), volume(block.places)
                self.assertAlmostEqual(self.info(path)["blocks"][0]["volume"] / exact, 1, delta=1e-9)
                for scalar in "pc":
                    found = self.manifest(self.convert([path], scalar))["volume"]
                    self.assertAlmostEqual(found / exact, 1, delta=1e-3)


if __name__ == "__main__":
    unittest.main(verbosity=2)
