#!/usr/bin/python3
"""xdmf_test.py CURVISPLAT

XDMF files of structured grids, with arrays in HDF5 (h5py), in binary files (numpy) and in the XML itself, against VTK's files of
the same grids. Exit status 77 (skipped) without python3-vtk9 or python3-h5py.
"""
import os
import resource
import subprocess
import sys
import unittest

from structured_formats import PROGRAM, RANDOM, Block, StructuredFormats, np
from sweep import IS_WHOLE, ONLY_WHOLE, some_of

try:
    import h5py
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-h5py")
    sys.exit(77)


def dims(shape):
    return " ".join(map(str, shape))


def slab(all_of, start, stride, count):
    """A part of a data item."""
    numbers = dims((*start, *stride, *count))
    return f'<DataItem ItemType="HyperSlab" Dimensions="{dims(count)}"><DataItem Dimensions="3 {len(count)}" Format="XML">{numbers}</DataItem>{all_of}</DataItem>'


class Writer:
    """Puts arrays into a file beside the XML, and describes them as data items."""

    def __init__(self, folder, kind="HDF", order="<", **options):
        self.folder, self.kind, self.order, self.options, self.count = folder, kind, order, options, 0
        self.binary = b""

    def item(self, values, stored_shape=None):
        self.count += 1
        number = {"f": "Float", "i": "Int", "u": "UInt"}[values.dtype.kind]
        head = f'<DataItem Dimensions="{dims(values.shape)}" NumberType="{number}" Precision="{values.dtype.itemsize}" Format="{self.kind}"'
        if self.kind == "XML":
            return head + ">" + " ".join(repr(float(v)) for v in values.ravel()) + "</DataItem>"
        stored = values.astype(values.dtype.newbyteorder(self.order)).reshape(stored_shape or values.shape)
        if self.kind == "Binary":
            endian = {"<": "Little", ">": "Big"}[self.order]
            seek = len(self.binary)
            self.binary += stored.tobytes()
            (self.folder / "a.bin").write_bytes(self.binary)
            return head + f' Endian="{endian}" Seek="{seek}">a.bin</DataItem>'
        with h5py.File(self.folder / "a.h5", "a") as file:
            file.create_dataset(f"group/{self.count}", data=stored, **self.options)
        return head + f">\n a.h5:/group/{self.count}\n</DataItem>"


def geometry(writer, block, kind="XYZ", **options):
    if kind == "XYZ":
        items = writer.item(np.moveaxis(block.places, 0, -1).copy(), **options)
    else:
        items = "".join(writer.item(axis) for axis in block.places)
    return f'<Topology TopologyType="3DSMesh" Dimensions="{dims(block.shape)}"/><Geometry GeometryType="{kind}">{items}</Geometry>'


def attribute(writer, name, values, centre="Node", kind="Scalar"):
    return f'<Attribute Name="{name}" AttributeType="{kind}" Center="{centre}">{writer.item(values)}</Attribute>'


def grid(writer, block, name="a", time=None, **options):
    of_time = "" if time is None else f'<Time Value="{time}"/>'
    fields = attribute(writer, "p", block.p) + attribute(writer, "c", block.c, "Cell")
    return f'<Grid Name="{name}">{of_time}{geometry(writer, block, **options)}{fields}</Grid>'


class Xdmf(StructuredFormats):
    def write(self, grids, version="3.0", entities=""):
        path = self.folder / "a.xmf"
        path.write_text(f'<?xml version="1.0"?>\n<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" [{entities}]>\n<Xdmf Version="{version}"><Domain>\n'
                        f"{grids}\n</Domain></Xdmf>\n")
        return path

    def new(self, *words, **options):
        for name in ("a.h5", "a.bin"):
            (self.folder / name).unlink(missing_ok=True)
        return Writer(self.folder, *words, **options)

    def test_storages(self):
        cases = [(kind, storage, of) for storage in ((("HDF",), {}), (("HDF", ">"), {}), (("HDF",), {"chunks": True, "compression": "gzip"}),
                                                     (("Binary", "<"), {}), (("Binary", ">"), {}), (("XML",), {}))
                 for kind in ("f4", "f8") for of in ("XYZ", "X_Y_Z")]
        blocks = {kind: [Block(kind=kind), Block((4, 3, 5), 9, kind)] for kind in ("f4", "f8")}
        for kind, (words, options), of in some_of(cases, 3):  # usually each storage with another of the others
            writer = self.new(*words, **options)
            self.expect_same([self.write("".join(grid(writer, b, f"g{n}", kind=of) for n, b in enumerate(blocks[kind])))], blocks[kind])
        self.assertEqual([b["name"] for b in self.info(self.folder / "a.xmf")["blocks"]], ["g0", "g1"])

    def test_arrays_of_other_shapes(self):
        """An HDF5 data set that is flat, or whose dimensions are cut elsewhere than the item's."""
        block = Block()
        nk, nj, ni = block.shape
        for shape in ((-1,), (-1, 3), (nk * nj, ni, 3), (nk, nj * ni * 3), (1, nk, nj, ni, 3)):
            writer = self.new()
            self.expect_same([self.write(grid(writer, block, stored_shape=shape))], [block])

    def test_types(self):
        block = Block()
        for kind, values in (("i1", (-128, 128)), ("u1", (0, 256)), ("i2", (-(2**15), 2**15)), ("u4", (0, 2**32)), ("i8", (-(2**52), 2**52))):
            block.p = RANDOM.integers(*values, block.shape).astype(kind)
            for storage in ("HDF", "Binary"):
                writer = self.new(storage)
                path = self.write(f'<Grid>{geometry(writer, block)}{attribute(writer, "p", block.p)}</Grid>')
                info = self.info(path)
                scalar = info["scalars"][0]
                self.assertEqual([scalar["min"], scalar["max"]], [np.float32(block.p.min()), np.float32(block.p.max())])

    def test_vectors(self):
        block = Block()
        v = RANDOM.random((*block.shape, 3))
        writer = self.new()
        path = self.write(f'<Grid>{geometry(writer, block)}{attribute(writer, "v", v, kind="Vector")}</Grid>')
        scalars = {s["name"]: [s["min"], s["max"]] for s in self.info(path)["scalars"]}
        expected = {"v:mag": np.linalg.norm(v, axis=-1), "v:x": v[..., 0], "v:y": v[..., 1], "v:z": v[..., 2]}
        self.assertEqual(list(scalars), list(expected))
        for name, values in expected.items():
            np.testing.assert_allclose(scalars[name], [values.min(), values.max()], rtol=1e-6)
        block.p = v[..., 1].copy()
        self.expect_same([path], [block], {"p": "v:y", "c": None})
        # In parts, which a function joins.
        for function in ("JOIN($0, $1, $2)", "join($0,$1,$2)"):
            writer = self.new()
            items = "".join(writer.item(v[..., n].copy()) for n in range(3))
            joined = f'<DataItem ItemType="Function" Function="{function}" Dimensions="{dims(v.shape)}">{items}</DataItem>'
            path = self.write(f'<Grid>{geometry(writer, block)}<Attribute Name="v" AttributeType="Vector">{joined}</Attribute></Grid>')
            self.expect_same([path], [block], {"p": "v:y", "c": None})
        # What is computed otherwise is left out, and does not stop the others.
        writer = self.new()
        computed = f'<DataItem ItemType="Function" Function="$0 + $1">{writer.item(v[..., 0].copy()) * 2}</DataItem>'
        path = self.write(f'<Grid>{geometry(writer, block)}{attribute(writer, "p", block.p)}<Attribute Name="s">{computed}</Attribute></Grid>')
        self.expect_same([path], [block], {"c": None})
        self.assertIn("attribute s is left out", " ".join(self.info(path)["warnings"]))

    def test_rectilinear_and_uniform(self):
        block = Block()
        shape = block.shape
        axes = [np.cumsum(RANDOM.random(n) + 0.1) for n in shape[::-1]]
        block.places = np.stack(np.meshgrid(axes[2], axes[1], axes[0], indexing="ij")[::-1])
        writer = self.new()
        topology = '<Topology TopologyType="{}" NumberOfElements="' + dims(shape) + '"/>'
        fields = attribute(writer, "p", block.p) + attribute(writer, "c", block.c, "Cell")
        items = "".join(writer.item(axis) for axis in axes)
        path = self.write(f'<Grid>{topology.format("3DRectMesh")}<Geometry GeometryType="VXVYVZ">{items}</Geometry>{fields}</Grid>')
        self.expect_same([path], [block])
        # Origin and spacing are in the order of the dimensions: z, y, x.
        origin, spacing = np.array([3.0, 2.0, 1.0]), np.array([0.5, 0.25, 2.0])
        k, j, i = np.meshgrid(*(o + s * np.arange(n) for o, s, n in zip(origin, spacing, shape)), indexing="ij")
        block.places = np.stack([i, j, k])
        items = writer.item(origin) + writer.item(spacing)
        path = self.write(f'<Grid>{topology.format("3DCoRectMesh")}<Geometry GeometryType="ORIGIN_DXDYDZ">{items}</Geometry>{fields}</Grid>')
        self.expect_same([path], [block])

    def test_times(self):
        blocks = [Block() for _ in range(3)]
        writer = self.new()
        steps = [grid(writer, b, "moving", 0.5 * n) for n, b in enumerate(blocks)]
        temporal = '<Grid GridType="Collection" CollectionType="Temporal">{}</Grid>'
        bare = "".join(step.replace(f'<Time Value="{0.5 * n}"/>', "") for n, step in enumerate(steps))
        listed = '<Time TimeType="List"><DataItem Dimensions="3" Format="XML">0 0.5 1</DataItem></Time>'
        spread = '<Time TimeType="HyperSlab"><DataItem Dimensions="3" Format="XML">0 0.5 3</DataItem></Time>'
        stored = f'<Time TimeType="List">{writer.item(np.array([0, 0.5, 1]))}</Time>'
        for turn, text in enumerate(("".join(steps), listed + bare, spread + bare, stored + bare)):
            path = self.write(temporal.format(text))
            self.assertEqual(self.info(path)["times"], [0, 0.5, 1])
            for n, block in some_of(enumerate(blocks), 3, turn=turn):
                self.expect_same([path], [block], options=["--time-step", n])
        self.assertEqual(self.info(self.write(temporal.format(bare)))["times"], [0, 1, 2])
        both = '<Grid GridType="Collection" CollectionType="Spatial"><Time Value="{}"/>{}</Grid>'
        path = self.write(temporal.format(both.format(1, bare[:0] + steps[0].replace('<Time Value="0.0"/>', "") + grid(writer, blocks[1], "b"))))
        self.expect_same([path], [blocks[0], blocks[1]])

    def test_hyperslabs_and_references(self):
        """A step of an array of all steps; every second node; a topology and an item that stand elsewhere."""
        blocks = [Block(), Block()]
        writer = self.new()
        places = np.stack([np.moveaxis(b.places, 0, -1) for b in blocks])
        wide = RANDOM.random((2, *[2 * n - 1 for n in blocks[0].shape]))
        for b, w in zip(blocks, wide):
            b.p = w[::2, ::2, ::2].copy()
        shape = blocks[0].shape
        for n, block in enumerate(blocks):
            where = slab(writer.item(places), (n, 0, 0, 0, 0), (1, 1, 1, 1, 1), (1, *shape, 3))
            p = slab('<DataItem Reference="/Xdmf/Domain/DataItem[1]"/>', (n, 0, 0, 0), (1, 2, 2, 2), (1, *shape))
            path = self.write(f'{writer.item(wide)}<Topology Name="t" TopologyType="3DSMesh" Dimensions="{dims(shape)}"/>'
                              f'<Grid><Topology Reference="XML">/Xdmf/Domain/Topology[@Name="t"]</Topology><Geometry>{where}</Geometry>'
                              f'<Attribute Name="p">{p}</Attribute></Grid>')
            self.expect_same([path], [block], {"c": None})

    def test_steps_of_hyperslabs(self):
        """One component of a vector, parts of parts, and steps shorter and longer than a buffer, of arrays in every storage."""
        block = Block()
        shape, ones = block.shape, (1, 1, 1)
        v, times = RANDOM.random((*shape, 3)), RANDOM.random((*shape, 5003))
        wide = RANDOM.random([4 * n for n in shape])
        for turn, (words, stored) in enumerate(((("HDF",), None), (("HDF",), (-1,)), (("Binary",), None), (("XML",), None))):
            cases = [(v, v[..., 1], lambda item: slab(item, (0, 0, 0, 1), (1, 1, 1, 1), (*shape, 1))),
                     (v, v[1:, :, :, 2], lambda item: slab(item, (1, 0, 0, 2), (1, 1, 1, 9), (shape[0] - 1, *shape[1:], 1))),
                     (wide, wide[1::4, 2::4, 3::4], lambda item: slab(item, (1, 2, 3), (4, 4, 4), shape)),
                     (wide, wide[2::4, 2::4, 2::4], lambda item: slab(slab(item, (0, 0, 0), (2, 2, 2), [2 * n for n in shape]), ones, (2, 2, 2), shape))]
            if words != ("XML",):
                cases.append((times, times[..., 17], lambda item: slab(item, (0, 0, 0, 17), (1, 1, 1, 1), (*shape, 1))))
            for all_of, expected, part in some_of(cases, 2, turn=turn):
                used = Block(expected.shape)
                used.p = expected.copy()
                writer = self.new(*words)
                path = self.write(f'<Grid>{geometry(writer, used)}<Attribute Name="p">{part(writer.item(all_of, stored))}</Attribute></Grid>')
                self.expect_same([path], [used], {"c": None})

    def within(self, kind, limit, *words):
        """A run of the program under a limit of the system."""
        result = subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, check=False,
                                preexec_fn=lambda: resource.setrlimit(kind, (limit, limit)))
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_far_steps_of_hyperslabs(self):
        """Numbers far from one another: the array between them is not read."""
        block = Block((3, 3, 3))
        writer = self.new()
        far = 1 << 25
        with h5py.File(self.folder / "far.h5", "w") as file:
            data = file.create_dataset("p", shape=(27 * far,), dtype="f8", chunks=(1 << 12,), fillvalue=0.5)
            data[26 * far] = 0.75
        item = f'<DataItem Dimensions="{27 * far}" Format="HDF">far.h5:/p</DataItem>'
        for text in (item, item.replace(str(27 * far), f"27 {far}")):
            part = slab(text, (0,), (far,), (27,)) if text == item else slab(text, (0, 0), (1, far), (27, 1))
            path = self.write(f'<Grid>{geometry(writer, block)}<Attribute Name="p">{part}</Attribute></Grid>')
            self.assertLess(self.peak_memory(path, "p", "160M"), 160 << 20)
            scalar = self.info(path)["scalars"][0]
            self.assertEqual([scalar["min"], scalar["max"]], [0.5, 0.75])

    def test_more_files_than_may_be_open(self):
        grids, blocks = "", [Block((2, 3, 4), 9 * n) for n in range(80)]
        for n, block in enumerate(blocks):
            text = grid(self.new(chunks=True), block, f"g{n}")
            (self.folder / "a.h5").rename(self.folder / f"b{n}.h5")
            grids += text.replace("a.h5", f"b{n}.h5")
        path = self.write(grids)
        self.within(resource.RLIMIT_NOFILE, 60, "info", path)
        self.expect_same([path], blocks)

    def test_items_that_many_refer_to(self):
        """Numbers in the XML are kept once, however many refer to them."""
        block = Block((40, 50, 50))
        fields = "".join(f'<Attribute Name="p{n}"><DataItem Reference="/Xdmf/Domain/DataItem[1]"/></Attribute>' for n in range(300))
        text = self.new("XML").item(block.p.round(3))
        path = self.write(f'{text}<Grid>{geometry(self.new("Binary"), block)}{fields}</Grid>')
        self.assertLess(self.peak_memory(path, "p7", "160M"), 160 << 20)

    def test_entities(self):
        """Names of files and dimensions that the XML's own DTD defines."""
        block = Block()
        shape = dims(block.shape)
        text = grid(self.new(), block)
        entities = (f"""<!-- <!ENTITY HeavyData "wrong"> "unpaired --><!ENTITY HeavyData "a.h5">\n<!ENTITY HeavyData 'later.h5'>"""
                    f"""<!ELEMENT Xdmf (Domain)><!ENTITY nodes '{shape}'><!ENTITY path "&HeavyData;:/group">"""
                    """<!ENTITY other SYSTEM "other.xml"><!ENTITY % parameter "a.h5"><?word "?>""")
        text = text.replace("a.h5:/group/1", "&path;/1").replace("a.h5", "&HeavyData;").replace(f'"{shape}"', '"&nodes;"')
        for reference in ("&path;", "&HeavyData;", "&nodes;"):
            self.assertIn(reference, text)
        path = self.write(text.replace("<Grid", '<Information Name="R&amp;D &#60;&undefined;"/><Grid', 1), entities=entities)
        self.expect_same([path], [block])
        self.expect_harmless(path)
        first, *rest = (f'<!ENTITY a{n} "{10 * f"&a{n + 1};"}">' for n in range(7))
        for defined, word, told in (
                (entities, "&other;", "is in another file"),
                ('<!ENTITY a "&b;"><!ENTITY b "&a;">', "&a;", "refer to one another"),
                (first + "".join(rest) + '<!ENTITY a7 "0123456789">', "&a0;", "longer by more than 1 MiB"),
                (first + "".join(rest) + '<!ENTITY a7 "">', "&a0;", "more than 1048576 times"),
                ('<!ENTITY a "b.h5">', "&a;", "b.h5, which does not exist"),
                ('<!ENTITY a "b.h5', "&a;", "not valid XML")):
            self.expect_line(self.write(grid(self.new(), block).replace("a.h5", word, 1), entities=defined), words=told)

    def test_attributes_that_some_grids_lack(self):
        a, b = Block(), Block((4, 3, 5), 9)
        writer = self.new()
        path = self.write(grid(writer, a) + f'<Grid Name="b">{geometry(writer, b)}{attribute(writer, "c", b.c, "Cell")}</Grid>')
        b.p[:] = np.nan
        self.expect_same([path], [a, b])
        self.assertIn("1 of 2 grids have no attribute p", self.run_program("info", path).stdout)

    def test_values_that_are_not_finite(self):
        block = Block()
        block.p[2, 1, 3], block.p[0, 0, 0], block.p[1, 4, 6] = np.nan, np.inf, -np.inf
        for kind in ("HDF", "Binary"):
            path = self.write(grid(self.new(kind), block))
            self.expect_same([path], [block])
            self.assertEqual(self.info(path)["blanked"]["not_finite"], 3)

    def test_what_is_refused(self):
        block = Block()
        writer = self.new()
        text = grid(writer, block)
        shape = dims(block.shape)
        for damaged, told in ((text.replace("3DSMesh", "Tetrahedron"), "has no DataItem"), (text.replace("3DSMesh", "Tesseract"), "has the topology Tesseract"),
                              (text.replace(f'3DSMesh" Dimensions="{shape}"', '3DSMesh" Dimensions="1 30 7"'), "is flat"),
                              (text.replace(f'3DSMesh" Dimensions="{shape}"', '3DSMesh" Dimensions="9 9 9"'), "expected 2187"),
                              (text.replace("a.h5", "b.h5"), "does not exist"), (text.replace("/group/1", "/group/9"), "no such data set"),
                              (text.replace("/group/1", "/group"), "no such data set"), (text.replace("a.h5:/group/1", "a.h5"), "expected FILE:/DATA"),
                              (text.replace('Format="HDF"', 'ItemType="Function"'), "is a function"), (text.replace("HDF", "TIFF"), "tiff"),
                              (text.replace(f'Dimensions="{shape} 3"', f'Dimensions="{shape} -3"'), "expected dimensions"),
                              (text.replace(f'Dimensions="{shape} 3"', 'Dimensions="1e12 1e12 1e12"'), "impossible dimensions"),
                              ('<Grid><Topology Reference="/Xdmf/Domain/Grid/Topology"/></Grid>', "refers to itself"),
                              ('<Grid><Topology Reference="//*[//*]"/></Grid>', "refers to"),
                              ('<Grid><xi:include href="b.xmf"/></Grid>', "another file (XInclude)"), ("", "has no Grid"), (text[:-9], "not valid XML")):
            self.expect_line(self.write(damaged), words=told)
        info = self.info(self.write(text.replace("/group/1", "/group/1|0:1:9:9")))
        self.assertIn('selects a part of its data, "|0:1:9:9"', "".join(info["warnings"]))
        bad = self.new("Binary")
        path = self.write(grid(bad, block))
        (self.folder / "a.bin").write_bytes(bad.binary[:-1])
        self.expect_line(path, words="truncated")

    def test_limits_of_included_parts(self):
        block = Block()
        text = grid(self.new(), block).replace("<Grid", '<Grid Name="a"', 1)
        include = lambda *pointers: "".join(f'<xi:include xpointer="xpointer({pointer})"/>' for pointer in pointers)
        for included, told in ((include("//a[1]"), "which the file does not have"), (include("//*[count(//*) > 1]"), "which is not read"),
                               (include("//Grid" + "[@Name='a']" * 100), "which is not read"), (include("//Grid[@Name='own']"), "Grid own has no Topology"),
                               ("<b/>" * 1100 + include("//b") * 1000, "includes more than 1000000 elements"),
                               ("<b/>" * 5000 + include(*(f"//b[{n}]" for n in range(1, 4500))), "has too many includes")):
            path = self.write(f'{text}<Grid Name="own">{included}</Grid>')
            with self.subTest(told=told):
                self.expect_line(path, words=told)

    def test_where_hdf5_files_lead(self):
        block = Block((3, 4, 5))
        (self.folder / "in").mkdir()
        writer = Writer(self.folder / "in")
        text = grid(writer, block)
        path, data = self.folder / "in" / "a.xmf", self.folder / "in" / "a.h5"
        path.write_text(f'<Xdmf Version="3.0"><Domain>{text}</Domain></Xdmf>')
        with h5py.File(data) as file:
            place = file["group/1"][...]
        os.mkfifo(self.folder / "in" / "pipe")
        (self.folder / "in" / "loop.h5").symlink_to("loop.h5")
        for name in (self.folder / "out.h5", self.folder / "in" / "b.h5"):
            with h5py.File(name, "w") as file:
                file["a"] = place
                file["link"] = h5py.ExternalLink("pipe", "/a")
        with h5py.File(self.folder / "in" / "c.h5", "w") as file:
            file["a"] = place

        def link(to, name="/a"):
            return lambda file: file.__setitem__("group/1", h5py.ExternalLink(to, name))

        def virtual(*sources):
            def make(file):
                layout = h5py.VirtualLayout(place.shape, "f8")
                for n, (name, dataset) in enumerate(sources):
                    part = slice(n, None, len(sources))
                    layout[part] = h5py.VirtualSource(name, dataset, place.shape)[part]
                file["group"].create_virtual_dataset("1", layout)
            return make

        def raw(file):
            c = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
            c.set_external(b"raw", 0, place.nbytes)
            h5py.h5d.create(file["group"].id, b"1", h5py.h5t.IEEE_F64LE, h5py.h5s.create_simple(place.shape), c)

        def here(file):
            file["stored"] = place
            virtual((".", "/stored"), ("c.h5", "a"))(file)

        out, elsewhere = str(self.folder / "out.h5"), "which lies outside the folder of the file"
        nested = "which is a virtual data set itself"
        for make, told in ((link("c.h5"), None), (link(str(self.folder / "in" / "c.h5")), None), (virtual(("c.h5", "a")), None), (here, None),
                           (link("/moved/c.h5"), None), (virtual(("c.h5", "a"), ("none.h5", "a")), "takes values from none.h5, which is not found"),
                           (virtual(("c.h5", "b")), "there is no such data set"), (virtual(("loop.h5", "a")), "takes values from loop.h5, which is not found"),
                           (link("pipe"), "pipe, which is not a regular file"),
                           (link("b.h5"), "pipe, which is not a regular file"), (virtual(("b.h5", "a")), "pipe, which is not a regular file"),
                           (link(out), elsewhere), (link("../out.h5"), elsewhere), (virtual((out, "a")), elsewhere),
                           (virtual(("pipe", "a")), "pipe, which is not a regular file"), (virtual((".", "/group/1")), nested),
                           (virtual((".", "group/./1")), nested), (virtual(("a.h5", "/group/1")), nested),
                           (raw, "store them in this one")):
            with h5py.File(data, "a") as file:
                for name in ("group/1", "stored"):
                    if name in file:
                        del file[name]
                make(file)
            if told:
                self.expect_line(path, words=told)
            else:
                self.info(path)

    def test_damage(self):
        block = Block((3, 4, 5))
        path = self.write(grid(self.new(), block))
        self.assertGreater(self.expect_harmless(path), 0.3)
        self.expect_harmless(self.folder / "a.h5", opened=path)
        path = self.write(grid(self.new("XML"), block))
        self.expect_harmless(path)

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)  # LongRows of format_memory_test.py has a file within the least memory
    def test_memory(self):
        block = Block((120, 120, 151), kind="f4")
        for words, options in ((("HDF",), {"chunks": (8, 64, 64), "compression": "gzip"}), (("Binary",), {})):
            writer = self.new(*words)
            if options:
                with h5py.File(self.folder / "a.h5", "w") as file:
                    for n, array in enumerate((np.moveaxis(block.places, 0, -1), block.p), 1):
                        file.create_dataset(f"group/{n}", data=array, chunks=(*options["chunks"], 3)[: array.ndim], compression="gzip", compression_opts=1)
                head = f'<Topology TopologyType="3DSMesh" Dimensions="{dims(block.shape)}"/>'
                path = self.write(f'<Grid>{head}<Geometry><DataItem Dimensions="{dims(block.shape)} 3" Format="HDF">a.h5:/group/1</DataItem></Geometry>'
                                  f'<Attribute Name="p"><DataItem Dimensions="{dims(block.shape)}" Format="HDF">a.h5:/group/2</DataItem></Attribute></Grid>')
            else:
                path = self.write(f'<Grid>{geometry(writer, block)}{attribute(writer, "p", block.p)}</Grid>')
            self.assertLess(self.peak_memory(path, "p", "192M"), 192 << 20)


if __name__ == "__main__":
    unittest.main(verbosity=2)
