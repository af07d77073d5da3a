#!/usr/bin/python3
"""Drives the server's page in Chromium: navigation, the function's editor, cuts, time, sizes, lost connections; and pages of `render`.

    page_test.py PROGRAM [FOLDER]    FOLDER: keeps the screenshots there
"""
import base64
import json
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from serving import Chromium, Viewer, serving, wait_for  # noqa: E402

program = pathlib.Path(sys.argv[1]).resolve()
shots = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None
failures = []
PAGE = "window.curvisplatPage"
FINAL = f"{PAGE}.header && {PAGE}.header.final && {PAGE}.idle()"
MIDDLE = (800, 400)
RATIO = 0.3125  # pixels of a picture to one of the page: a tenth of the work
IS_WHOLE = "CURVISPLAT_WHOLE" in os.environ


def expect(condition, what):
    if not condition:
        failures.append(what)
        print("FAILED:", what)


def shot(tab, name):
    if shots:
        shots.mkdir(parents=True, exist_ok=True)
        tab.screenshot(shots / f"{name}.png")


# The sum of the final picture's pixels, taken once a picture; null until it is there.
SUM = f"""(() => {{ if (!({FINAL})) return null;
  const drawn = {PAGE}.pictures;
  if (!window.summed || summed[0] !== drawn) {{
    const c = document.getElementById('picture'), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let h = 0;
    for (let n = 0; n < d.length; ++n) h = (h * 31 + d[n]) >>> 0;
    window.summed = [drawn, h];
  }}
  return summed; }})()"""


def rest(tab):
    """Waits until the picture of the page's last request is lossless, and returns its pixels' sum."""
    return tab.wait(SUM, "a final picture")[1]


def changes(tab, act, what, name=None):
    """`act` leads to another final picture."""
    before = rest(tab)
    act()
    try:
        wait_for(lambda: rest(tab) != before, f"{what} to change the picture", 20)
    except AssertionError as error:
        expect(False, error)
    if name:
        shot(tab, name)


def set_value(tab, selector, value):
    tab.run(f"(() => {{ const e = document.querySelector('{selector}'); if (e.type === 'checkbox') e.checked = {value!r} === 'on';"
            f"else e.value = {value!r}; e.dispatchEvent(new Event('input')); e.dispatchEvent(new Event('change')); }})()")


def drag_until(tab, condition):
    """Moves the mouse with its button down until the condition holds."""
    way = iter(range(10 ** 9))

    def moved():
        tab.mouse("mouseMoved", MIDDLE[0] + next(way) % 150, MIDDLE[1] + 30, buttons=1)
        return condition()

    tab.mouse("mousePressed", *MIDDLE, buttons=1)
    wait_for(moved, "pictures to come while the mouse moves")
    tab.mouse("mouseReleased", MIDDLE[0] + 100, MIDDLE[1] + 30)


def opened(browser, url, size=(1280, 800)):
    tab = browser.tab(url, size, RATIO)
    tab.wait(f"{PAGE} && {PAGE}.pictures > 0", "a first picture")
    return tab


def differing_from(tab, file, by=0):
    """How many bytes of the page's picture differ from the PNG file's by more than `by`."""
    png = base64.b64encode(pathlib.Path(file).read_bytes()).decode()
    return tab.run(f"""(async () => {{
      const image = await createImageBitmap(new Blob([Uint8Array.from(atob('{png}'), c => c.charCodeAt(0))], {{type: 'image/png'}}));
      const c = document.getElementById('picture'), other = new OffscreenCanvas(c.width, c.height);
      if (image.width !== c.width || image.height !== c.height) return 'another size';
      other.getContext('2d').drawImage(image, 0, 0);
      const a = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
      const b = other.getContext('2d').getImageData(0, 0, c.width, c.height).data;
      let n = 0; for (let k = 0; k < a.length; ++k) n += Math.abs(a[k] - b[k]) > {by}; return n; }})()""")


def copies_the_command(tab, caches, edited, colours=None):
    """The command that the page shows draws its picture, in the folder of the cache; an edited function is in a file, one with
    the built-in map `colours` is not."""
    # The grid's lines that lie behind the data are in the command's picture alone.
    tab.run("state.axes_grid = false; showState(); changed()")
    if edited:
        before = rest(tab)
        tab.run("setPoints([[0, 0.2], [0.3, 0.9], [1, 0.1]].map(([u, opacity]) => ({ u, opacity, midpoint: 0.25, sharpness: 0.5 }))); changed()")
        wait_for(lambda: rest(tab) != before, "an edited function")
    rest(tab)
    tab.run("document.getElementById('copied-title').textContent = ''; document.getElementById('copy-command').click()")
    tab.wait("document.getElementById('copied').open", "the command")
    text = tab.run("document.getElementById('copied-text').value")
    files = tab.run("[...document.querySelectorAll('#copied-files button')].map(b => b.textContent)")
    shot(tab, "command")
    tab.run("download = async (blob, name) => { window.saved = [name, await blob.text()]; }")
    for n in range(len(files)):
        tab.run(f"window.saved = null; document.querySelectorAll('#copied-files button')[{n}].click()")
        name, content = tab.wait("window.saved", "the function's file")
        (pathlib.Path(caches[0]).parent / name).write_text(content)
    tab.run("document.getElementById('copied').close()")
    expect("/" not in text.split()[2], f"the command names no folder of the server: {text}")
    expect(len(files) == (1 if edited else 0), f"files of functions: {files}")
    if colours:
        expect(f"--tf {colours} --range" in text, f"the command names the map {colours}: {text}")
    words = shlex.split(text)
    expect(words[:2] == ["curvisplat", "render"], text)
    subprocess.run([program, *words[1:]], cwd=pathlib.Path(caches[0]).parent, check=True, capture_output=True)
    # Numbers of the command have six digits.
    differing = differing_from(tab, pathlib.Path(caches[0]).parent / "picture.png", by=3)
    expect(isinstance(differing, int) and differing < 200, f"the command draws the page's picture: {differing} bytes differ: {text}")
    return text


def is_the_commands_picture(tab, server_caches):
    """The lossless picture on the page is the file that `render` writes."""
    rest(tab)
    state = tab.run(f"{PAGE}.state")
    camera, function = state["camera"], state["function"]
    with tempfile.TemporaryDirectory() as folder:
        import json
        pathlib.Path(folder, "f.json").write_text(json.dumps([function]))
        width, height = tab.run(f"[{PAGE}.header.width, {PAGE}.header.height]")
        numbers = lambda p: ",".join(repr(x) for x in p)  # noqa: E731
        command = [program, "render", server_caches[0], "-o", f"{folder}/p.png", "--size", f"{width}x{height}", "--scalar", state["variable"],
                   "--tf", f"{folder}/f.json", f"--position={numbers(camera['position'])}", f"--focal-point={numbers(camera['focal_point'])}",
                   f"--view-up={numbers(camera['view_up'])}", "--scalar-bar", "--axes",
                   *(["--view-angle", repr(camera["view_angle"])] if camera["perspective"] else
                     ["--parallel-scale", repr(camera["parallel_scale"])])]
        subprocess.run(command, check=True, capture_output=True)
        differing = differing_from(tab, f"{folder}/p.png")
        expect(differing == 0, f"the page has the pixels of `render`: {differing} bytes differ")


def navigation(browser, server, caches):
    tab = opened(browser, server.url)
    shot(tab, "first")
    waiting = "getComputedStyle(document.getElementById('stage'), '::before').content"
    expect("waiting" not in tab.run(waiting), "a page with a picture waits for none")
    tab.run("document.getElementById('stage').className = ''")
    expect("waiting for the first picture" in tab.run(waiting), "a page without a picture says that it waits")
    tab.run("document.getElementById('stage').className = 'drawn'")
    is_the_commands_picture(tab, caches)
    below = tab.run("['save', 'copy-command', 'copy-address'].filter(id => document.getElementById(id).getBoundingClientRect().bottom > innerHeight)")
    expect(not below, f"what saves and copies is in view: {below}")
    first = tab.run(f"{PAGE}.state.camera")
    tab.run("document.getElementById('picture').focus()")
    changes(tab, lambda: tab.key("o"), "the key o")
    expect(not tab.run(f"{PAGE}.state.camera.perspective"), "the first view is in perspective")
    before = tab.run(f"{PAGE}.pictures")
    changes(tab, lambda: drag_until(tab, lambda: tab.run(f"{PAGE}.pictures") - before > 3), "dragging", "rotated")
    camera = tab.run(f"{PAGE}.state.camera")
    changes(tab, lambda: tab.drag(MIDDLE, (850, 420), modifiers=8), "shift and drag")
    moved = tab.run(f"{PAGE}.state.camera")
    expect(camera["focal_point"] != moved["focal_point"] and camera["view_up"] == moved["view_up"], "shift and drag moves the camera sideways")
    changes(tab, lambda: tab.drag(MIDDLE, (800, 450), button="right"), "dragging with the right button")
    moved = tab.run(f"{PAGE}.state.camera")
    changes(tab, lambda: tab.mouse("mouseWheel", *MIDDLE, deltaX=0, deltaY=-300), "the wheel", "zoomed")
    expect(tab.run(f"{PAGE}.state.camera.parallel_scale") < moved["parallel_scale"], "the wheel zooms in")
    tab.run("document.getElementById('picture').focus()")
    for key in "xYzior":
        changes(tab, lambda key=key: tab.key(key), f"the key {key}", f"key_{key}")
    expect(tab.run(f"{PAGE}.state.camera.perspective"), "the key o changes the projection")
    changes(tab, lambda: tab.click("#projection"), "the box of the projection")
    tab.key("o")  # the focus is on the box: keys are the picture's even so
    rest(tab)
    expect(tab.run(f"{PAGE}.state.camera.perspective && document.getElementById('projection').checked"), "the box shows the projection")
    changes(tab, lambda: tab.run("document.querySelector('[data-view=\"-y\"]').click()"), "looking from -y")
    away = tab.run(f"(c => c.position.map((v, i) => Math.sign(Math.round(1e6 * (v - c.focal_point[i])))))({PAGE}.state.camera)")
    expect(away == [0, -1, 0], f"from -y the camera is at -y: {away}")
    changes(tab, lambda: tab.run("document.getElementById('first-view').click()"), "the first view")
    expect(tab.run(f"{PAGE}.state.camera") == first, "the first view is that with which the page opened")
    changes(tab, lambda: tab.key("x"), "the key x")
    changes(tab, lambda: tab.run("document.body.dispatchEvent(new KeyboardEvent('keydown', { key: 'R', shiftKey: true, bubbles: true }))"), "Shift and R")
    expect(tab.run(f"{PAGE}.state.camera") == first, "Shift and R show the first view, too")
    changes(tab, lambda: tab.run("document.querySelector('[data-view=\"-y\"]').click()"), "looking from -y again")
    tab.key("?")
    tab.wait("document.getElementById('keys').open", "the list of keys")
    shot(tab, "keys")
    box = tab.run("(() => { const r = document.getElementById('keys').getBoundingClientRect(); return [r.top, r.bottom]; })()")
    expect(box[0] >= 0 and box[1] <= 800, f"the list of keys is within the page: {box}")
    dark = tab.run(f"{PAGE}.state.dark")
    tab.key("b")
    expect(tab.run(f"{PAGE}.state.dark") == dark, "while the list is open, keys are not the picture's")
    tab.run("document.querySelector('#keys button').click()")
    changes(tab, lambda: tab.key("b"), "the key b")
    expect(tab.run(f"{PAGE}.state.dark") != dark, "b changes the background")
    changes(tab, lambda: tab.key("b"), "the key b")
    tab.key("h")
    tab.wait("document.getElementById('panel').offsetWidth === 0", "the panel to hide")
    rest(tab)
    expect(tab.run(f"{PAGE}.header.width") == 1280 * RATIO, "the picture takes the panel's place")
    tab.key("h")
    expect(tab.run(f"{PAGE}.errors.length") == 0, f"no errors: {tab.run(PAGE + '.errors')}")
    return tab


def press(tab, selector):
    tab.run(f"document.querySelector('{selector}').click()")


def objects(tab):
    """Faces and isosurfaces are added, hidden, moved and removed."""
    before = rest(tab)
    tab.run("keepAddress()")
    kept = tab.run("[statesAtRest.length, location.hash, JSON.stringify(state)]")
    press(tab, "#add-face")
    expect(tab.run("[...document.querySelectorAll('#face-names button')].map(o => o.textContent).includes('jmin')"), "the grid's faces are offered")
    name = "[...document.querySelectorAll('#face-names button')].find(o => o.textContent === 'jmin')"
    changes(tab, lambda: tab.run(f"{name}.dispatchEvent(new PointerEvent('pointerenter'))"), "pointing at a face's name", "face_pointed")
    shown = rest(tab)
    orange = tab.run("""(() => { const c = document.getElementById('picture'), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
      let n = 0; for (let k = 0; k < d.length; k += 4) n += d[k] > d[k + 1] + 40 && d[k + 1] > d[k + 2] + 20; return n; })()""")
    expect(orange > 500, f"the face is tinted: {orange} pixels are orange")
    changes(tab, lambda: tab.run(f"{name}.dispatchEvent(new PointerEvent('pointerleave'))"), "leaving it")
    expect(rest(tab) == before != shown, "the picture is the one before")
    expect(tab.run("[statesAtRest.length, location.hash, JSON.stringify(state)]") == kept, "the view, its address and its undo are those before")
    changes(tab, lambda: tab.run(f"{name}.click()"), "a face of the grid", "face")
    expect(tab.run("document.getElementById('face-names').hidden"), "the list closes")
    changes(tab, lambda: tab.run("document.querySelector('#faces .row').dispatchEvent(new PointerEvent('pointerenter'))"), "pointing at a listed face")
    changes(tab, lambda: tab.run("document.querySelector('#faces .row').dispatchEvent(new PointerEvent('pointerleave'))"), "leaving it")
    changes(tab, lambda: set_value(tab, "#faces input[type=color]", "#ff0000"), "its colour")
    changes(tab, lambda: set_value(tab, "#faces input[type=range]", "0.3"), "its opacity")
    changes(tab, lambda: press(tab, "#faces .eye"), "its eye")
    expect(rest(tab) == before, "a hidden face is not drawn")
    press(tab, "#faces button:last-of-type")
    changes(tab, lambda: press(tab, "#add-iso"), "an isosurface", "isosurface")
    low, high = tab.run("range()")
    value = tab.run(f"{PAGE}.state.isosurfaces[0].value")
    # It halves what is seen: the bins of the histogram, each times its opacity. The function is linear.
    tab.wait("histogram && histogram.scalar === holder().variable", "the histogram")
    halves = tab.run("""(() => { const list = points(), at = u => { const n = Math.max(1, list.findIndex(p => p.u >= u));
        const [a, b] = [list[n - 1], list[n]]; return a.opacity + (u - a.u) / (b.u - a.u || 1) * (b.opacity - a.opacity); };
      const seen = histogram.bins.map((b, n) => b * at((n + 0.5) / histogram.bins.length)), all = seen.reduce((a, b) => a + b);
      let sum = 0; return seen.findIndex(b => (sum += b) > all / 2) / seen.length; })()""")
    expect(abs((value - low) / (high - low) - halves) < 0.02, f"it halves what is seen of {low} to {high}: {value}, not {halves}")
    expect(tab.run("document.querySelector('#isosurfaces .beyond').hidden"), "its value is within the scalar's range")
    set_value(tab, "#isosurfaces input[type=number]", "99")
    expect(not tab.run("document.querySelector('#isosurfaces .beyond').hidden"), "a value beyond the scalar's range is said to be so")
    set_value(tab, "#isosurfaces input[type=number]", repr(value))
    changes(tab, lambda: set_value(tab, "#isosurfaces input[type=number]", repr(low + 0.3 * (high - low))), "its value")
    changes(tab, lambda: press(tab, "#volume"), "the isosurface alone", "isosurface_alone")
    colour = "#isosurfaces input[type=color]"
    shown = rest(tab)
    of_function = tab.run(f"document.querySelector('{colour}').value")
    strip_colours = tab.run("strip.match(/.{6}/g)")
    at = int((tab.run(f"{PAGE}.state.isosurfaces[0].value") - low) / (high - low) * len(strip_colours))
    expect(of_function == "#" + strip_colours[at], f"its swatch has the function's colour {strip_colours[at]}: {of_function}")
    changes(tab, lambda: set_value(tab, colour, "#00ff00"), "a colour of its own", "isosurface_green")
    expect(tab.run(f"{PAGE}.state.isosurfaces[0].colour") == [0, 1, 0], "it is green")
    set_value(tab, "#isosurfaces input[type=checkbox]", "on")
    expect(rest(tab) == shown, "it has the function's colour again")
    copied = tab.run(f"{PAGE}.state.isosurfaces")
    expect(len(copied) == 1 and copied[0]["visible"], f"one isosurface: {copied}")
    press(tab, "#volume")
    changes(tab, lambda: press(tab, "#isosurfaces button:last-of-type"), "no isosurface")
    expect(rest(tab) == before, "the picture is the one before")


def typed_numbers(tab):
    """Places of planes, their normals, and the sides of the clip box are typed; undone and done again."""
    lower, upper = tab.run("[cache.lower, cache.upper]")
    changes(tab, lambda: press(tab, "#add-slice"), "a slice")
    before = rest(tab)
    changes(tab, lambda: press(tab, "#slices button:nth-of-type(2)"), "a slice across x")
    wanted = lower[0] + 0.3 * (upper[0] - lower[0])
    changes(tab, lambda: set_value(tab, "#slices .at", repr(wanted)), "its place")
    expect(abs(tab.run(f"{PAGE}.state.slices[0].point[0]") - wanted) < 1e-9, "it is where the number says")
    expect(tab.run("document.querySelector('#slices .at').previousSibling.previousSibling.textContent") == "x of plane", "the number is of x")
    x, y = tab.place(".grip")
    right, down = tab.run("document.querySelector('.grip').along")
    changes(tab, lambda: tab.drag((x, y), (x + 0.2 * right, y + 0.2 * down)), "its grip", "grip")
    moved = tab.run(f"{PAGE}.state.slices[0].point[0]") - wanted
    expect(abs(moved / (0.1 * (upper[0] - lower[0])) - 1) < 0.1, f"the grip follows the mouse: {moved}")
    changes(tab, lambda: set_value(tab, "#slices .at", repr(wanted)), "its place")
    changes(tab, lambda: set_value(tab, "#slices .triple input:nth-of-type(2)", "1"), "its tilt", "tilted")
    normal = tab.run(f"{PAGE}.state.slices[0].normal")
    expect(max(abs(a - b) for a, b in zip(normal, (0.5 ** 0.5, 0.5 ** 0.5, 0))) < 1e-9, f"a normal of 1, 1, 0: {normal}")
    tab.run("document.getElementById('picture').focus()")
    for _ in range(5):
        tab.run("document.dispatchEvent(new KeyboardEvent('keydown', { key: 'z', ctrlKey: true }))")
        rest(tab)
    expect(rest(tab) == before, "Ctrl+Z undoes the tilt, the places and the direction")
    tab.run("document.dispatchEvent(new KeyboardEvent('keydown', { key: 'Z', ctrlKey: true, shiftKey: true }))")
    expect(rest(tab) != before and tab.run(f"{PAGE}.state.slices[0].normal") == [1, 0, 0], "Ctrl+Shift+Z does the first again")
    press(tab, "#slices button:last-of-type")
    set_value(tab, "#clip", "on")
    changes(tab, lambda: set_value(tab, "#clip-x-upper-number", repr(wanted)), "a number of the clip box")
    expect(abs(tab.run(f"{PAGE}.state.clip_box.upper[0]") - wanted) < 1e-9, "the clip box ends where the number says")
    set_value(tab, "#clip", "off")
    rest(tab)


def choose_automatic(tab):
    tab.run("document.querySelector('#maps button').click()")  # the first of the list
    tab.wait(f"{PAGE}.state.preset === 'automatic'", "the automatic function")


def choose_map(tab, name):
    tab.run(f"document.querySelector('#maps [title={name}]').click()")


def numbers(tab):
    """What stands below the curve, in the function's own scale."""
    for low, high, log, expected in ((-2, 6, False, ["-2", "0", "2", "4", "6"]), (0.01, 100, True, ["0.01", "0.1", "1", "10", "100"]),
                                     (101325, 101327, False, ["101325", "101325.5", "101326", "101326.5", "101327"]),
                                     (-3e-9, 1e-9, False, ["-3e-9", "-2e-9", "-1e-9", "0", "1e-9"])):
        tab.run(f"setRange({low}, {high}, {'true' if log else 'false'}, null)")
        shown = tab.run("[0, 0.25, 0.5, 0.75, 1].map(numberAt)")
        expect(shown == expected, f"{low} to {high}: {shown}")
        tab.run("setRange(0.5, 1, false, null)")
    symmetric = "document.getElementById('symmetric').hidden"
    expect(tab.run(symmetric), "values above zero have no symmetric range")
    tab.run("window.lowest = shownScalar().low; shownScalar().low = -1; setRange(-0.25, 1, false, null)")
    expect(not tab.run(symmetric), "values of both signs have one")
    press(tab, "#symmetric")
    expect(tab.run("range()") == [-1, 1], f"zero is in its middle: {tab.run('range()')}")
    tab.run("shownScalar().low = lowest")
    choose_automatic(tab)


def editing(tab):
    rest(tab)
    x, y = tab.place("#curve")
    points = tab.run(f"{PAGE}.state.function.Points.length")
    changes(tab, lambda: tab.drag((x - 40, y - 40), (x - 40, y - 50), steps=5, pause_s=0.03), "a new point", "edited")
    expect(tab.run(f"{PAGE}.state.function.Points.length") == points + 4, "a click adds a point")
    added = tab.run(f"""(() => {{ const p = {PAGE}.state.function.Points, u = {x - 40} - document.getElementById('curve').getBoundingClientRect().x,
      width = document.getElementById('curve').clientWidth, [low, high] = [p[0], p[p.length - 4]];
      let n = 0; while (n < p.length && Math.abs((p[n] - low) / (high - low) * width - u) > 1.5) n += 4;
      const height = (document.getElementById('curve').clientHeight - 32); return [p[n + 1], height]; }})()""")
    top = y - tab.run("document.getElementById('curve').clientHeight / 2")
    up = 1 - (y - 50 - top) / added[1]
    expect(abs(added[0] - up * up) < 0.02, f"opacities stand on a scale of square roots: {added[0]} at {up}")
    changes(tab, lambda: tab.run(f"""document.getElementById('curve').dispatchEvent(new MouseEvent('dblclick',
      {{clientX: {x - 40}, clientY: {y - 50}, bubbles: true}}))"""), "removing a point")
    expect(tab.run(f"{PAGE}.state.function.Points.length") == points, "a double-click removes it")
    tab.click("#map")
    tab.wait("!document.getElementById('maps').hidden", "the colour maps")
    shot(tab, "maps")
    bands = tab.run("[...document.querySelectorAll('#maps i')].map(i => i.style.background)")
    expect(len(bands) > 60 and len(set(bands)) > 0.9 * len(bands), f"maps are told by their colours: {len(bands)}, {len(set(bands))}")
    expect("rgb(68, 1, 84)" in tab.run("document.querySelector('#maps [title=viridis] i').style.background"), "viridis begins with its violet")
    changes(tab, lambda: choose_map(tab, "magma"), "other colours", "colours")
    expect(tab.run("document.getElementById('maps').hidden && document.getElementById('map').textContent") == "magma", "its name is shown")
    numbers(tab)
    low, high = tab.run("range()")
    expect(tab.run("document.getElementById('finer').hidden"), "its range is not finer than the stored values")
    changes(tab, lambda: set_value(tab, "#high", repr(low + 1e-5)), "a range of less than a step of the stored values")
    tab.wait("!document.getElementById('finer').hidden", "the warning of it")
    expect("is finer than its stored values" in tab.run("document.getElementById('finer').textContent"), "the warning says why")
    changes(tab, lambda: set_value(tab, "#high", repr(high)), "the range before")
    tab.wait("document.getElementById('finer').hidden", "no warning any more")
    tab.wait("histogram && histogram.scalar === holder().variable", "the histogram")
    changes(tab, lambda: tab.click("#fit-percentiles"), "the range without one per cent at each end")
    stored = json.loads(subprocess.run([program, "info", "--json", f"{folder}/annulus.splats"], capture_output=True, text=True, check=True).stdout)["histograms"][0]
    expected = [stored["percentiles"][n] for n in (10, 990)]
    expect(all(abs(a - b) < 1e-5 for a, b in zip(tab.run("range()"), expected)), f"percentiles: {tab.run('range()')}, {expected}")
    changes(tab, lambda: set_value(tab, "#high", "0.8"), "another range")
    changes(tab, lambda: set_value(tab, "#unit", "0.5"), "another opacity unit")
    expect(tab.run("(ids => new Set(ids).size === ids.length)([...document.querySelectorAll('[id]')].map(e => e.id))"), "each id is one element's")
    for name, opacities in (("ramp", [0, 1]), ("clear", [0, 0]), ("band", [0, 0, 0.5, 0, 0]), ("high-values", [0, 0, 1])):
        changes(tab, lambda name=name: tab.click(f"#{name}"), f"the button {name}", name)
        found = tab.run(f"{PAGE}.state.function.Points")
        low, high = tab.run("range()")
        expect(found[1::4] == opacities, f"{name}: {found}")
        expect([found[0], found[-4]] == [low, high], f"{name} is of the range {low} to {high}: {found}")
    # The density is a hundredth of the data's diagonal over the opacity unit, logarithmic.
    changes(tab, lambda: set_value(tab, "#density", "1"), "the density")
    diagonal = tab.run("Math.hypot(...cache.upper.map((v, i) => v - cache.lower[i]))")
    unit = tab.run(f"{PAGE}.state.function.ScalarOpacityUnitDistance")
    expect(abs(unit / (diagonal / 1000) - 1) < 0.01, f"a density of 10 is a unit of {diagonal / 1000}: {unit}")
    changes(tab, lambda: set_value(tab, "#unit", repr(diagonal / 100)), "the opacity unit")
    expect(abs(float(tab.run("document.getElementById('density').value"))) < 0.011, "the density follows the unit")
    changes(tab, lambda: choose_automatic(tab), "the automatic function")
    for name in ("scalar_bar", "axes", "axes_grid", "outline", "dark", "lit"):
        changes(tab, lambda name=name: tab.click(f"#{name}"), name)
    shot(tab, "dark_and_lit")
    for name in ("shadow", "ambient_occlusion"):
        changes(tab, lambda name=name: set_value(tab, f"#{name}", "0.8"), name)
        set_value(tab, f"#{name}", "0")
    tab.run("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    changes(tab, lambda: (set_value(tab, "#clip", "on"), set_value(tab, "#clip-x-upper", "0.6")), "the clip box", "clipped")
    set_value(tab, "#clip", "off")
    changes(tab, lambda: tab.click("#add-clip"), "a clip plane")
    changes(tab, lambda: set_value(tab, "#clip_planes input", "0.3"), "moving the plane")
    changes(tab, lambda: tab.run("document.querySelector('#clip_planes button:last-of-type').click()"), "removing the plane")
    changes(tab, lambda: (tab.click("#add-slice"), press(tab, "#volume")), "a slice", "slice")
    changes(tab, lambda: press(tab, "#slices .eye"), "the slice's eye")
    expect(tab.run("document.getElementById('volume').getAttribute('aria-disabled')") == "true", "the volume cannot be hidden where nothing else is drawn")
    press(tab, "#slices .eye")
    press(tab, "#volume")
    press(tab, "#slices button:last-of-type")
    expect("once something else is shown" in tab.run("document.getElementById('volume').title"), "its eye says so")
    objects(tab)
    typed_numbers(tab)
    rest(tab)
    expect(tab.run(f"{PAGE}.errors.length") == 0, f"no errors: {tab.run(PAGE + '.errors')}")


def asinh_scale(tab, caches):
    """A function in asinh is edited by its own few points, on its own scale, and the command states them."""
    rest(tab)
    tab.run("(() => { const [low, high] = range(), size = high - low; setRange(low, high, false, [low + 0.1 * size, 0.05 * size]); "
            "askColours(state.parts.map); })()")
    tab.wait("state.function.RGBPoints.length === 4 * 257", "the colours on that scale")
    expect(tab.run("document.getElementById('asinh').checked"), "the scale is named")
    changes(tab, lambda: tab.click("#band"), "a band in asinh", "asinh_band")
    expect(tab.run("points().map(p => p.u)") == [0, 0.4, 0.5, 0.6, 1], f"it has the band's points: {tab.run('points()')}")
    low, high = tab.run("range()")
    expect(abs(tab.run("toUnit(fromUnit(0.3))") - 0.3) < 1e-9 and tab.run("fromUnit(0.5)") < low + 0.3 * (high - low), "values near the centre have more space")
    tab.wait("histogram && histogram.asinh", "the histogram in asinh")
    x, y = tab.place("#curve")
    changes(tab, lambda: tab.drag((x - 100, y - 20), (x - 100, y - 40), steps=5, pause_s=0.03), "a new point in asinh")
    expect(tab.run("points().length") == 6, "a click adds one point")
    tab.click("#band")
    text = copies_the_command(tab, caches, edited=False, colours=tab.run("state.parts.map"))
    expect("--asinh" in text and "0:0,0.4:0,0.5:0.5,0.6:0,1:0" in text, f"the command has the scale and the points: {text}")
    set_value(tab, "#low", repr(low + 0.05 * (high - low)))
    rest(tab)
    expect(tab.run("asinhOf() !== null && points().length") == 5, "another range keeps the scale")
    changes(tab, lambda: press(tab, "#asinh"), "a linear scale")
    expect(tab.run("asinhOf() === null && points().map(p => Math.round(1e6 * p.u) / 1e6)") == [0, 0.4, 0.5, 0.6, 1], f"the scale alone changes: {tab.run('points()')}")
    expect(not tab.run("document.getElementById('asinh').checkVisibility()"), "a scale that is not there cannot be switched on")
    press(tab, "#undo")
    rest(tab)
    expect(tab.run("document.getElementById('asinh').checked"), "undo brings it back")
    press(tab, "#ramp")
    tab.wait("asinhOf() === null && state.function.RGBPoints.length < 4 * 257", "a ramp on the map's own scale")
    choose_automatic(tab)
    rest(tab)


def saves_pictures(tab):
    """As shown, and of another size; the page says what was saved."""
    tab.run("window.saves = []; download = (blob, name) => window.saves.push([name, blob]); document.getElementById('save').click()")
    size = tab.run(f"[{PAGE}.header.width, {PAGE}.header.height]")
    expect(tab.run("document.getElementById('status').textContent") == f"saved annulus.png, {size[0]} x {size[1]} pixels", "what was saved is said")
    before = rest(tab)
    set_value(tab, "#save-size", "1920x1080")
    press(tab, "#save")
    tab.wait("window.saves.length === 2", "the larger picture")
    tab.run("createImageBitmap(window.saves[1][1]).then(b => { window.saved = [b.width, b.height]; })")
    expect(tab.wait("window.saved", "its size") == [1920, 1080], f"it has the size that was chosen: {tab.run('window.saved')}")
    expect(tab.run("document.getElementById('status').textContent") == "saved annulus.png, 1920 x 1080 pixels", "its size is said")
    expect(tab.run("document.getElementById('status').className") == "", "it is news, not an error")
    expect(rest(tab) == before, "the view is as it was")
    set_value(tab, "#save-size", "")
    tab.run("document.getElementById('save').click()")
    tab.wait("window.saves.length === 3", "the picture as it is now")
    # A marker is in what is saved, and by a sign of the page in what is shown.
    point = tab.run("cache.lower.map((v, n) => (v + cache.upper[n]) / 2)")
    tab.run(f"state.markers.push({{ name: 'here', point: {json.dumps(point)}, scalar: state.variable, unit: '', value: 0.5, block: 0, i: 0, j: 0, k: 0 }}); showMarkers()")
    press(tab, "#save")
    tab.wait("window.saves.length === 4", "the picture with a marker")
    tab.run("window.pixels = null; Promise.all([2, 3].map(n => createImageBitmap(window.saves[n][1]))).then(both => { "
            "window.pixels = both.map(b => { const c = new OffscreenCanvas(b.width, b.height).getContext('2d'); c.drawImage(b, 0, 0); "
            "return [...c.getImageData(0, 0, b.width, b.height).data]; }).reduce((a, b) => a.length === b.length ? a.filter((v, n) => v !== b[n]).length : -1); })")
    found = tab.wait("window.pixels", "both pictures' pixels")
    expect(100 < found < 0.1 * 4 * size[0] * size[1], f"a dot and a text were added: {found} channels differ")
    tab.run("state.markers.length = 0; showMarkers()")


def saves_what_it_says(browser, caches):
    """A picture that does not fit into the viewer's memory: the file comes, its size is said, and why, each time."""
    with serving(program, caches[:1], "--viewer-memory", "96M", "--memory", "96M", "--backend", "cpu") as server:
        tab = opened(browser, server.url)
        tab.run("window.saves = []; download = (blob, name) => window.saves.push([name, blob])")
        set_value(tab, "#save-size", "1920x1080")
        for n in (1, 2):
            rest(tab)
            press(tab, "#save")
            tab.wait(f"window.saves.length === {n}", "the picture")
            tab.run(f"window.saved = null; createImageBitmap(window.saves[{n - 1}][1]).then(b => {{ window.saved = [b.width, b.height]; }})")
            width, height = tab.wait("window.saved", "its size")
            said = tab.run("document.getElementById('status').textContent")
            expect((width, height) == (960, 540), f"the file has fewer pixels: {width} x {height}")
            expect(said.startswith(f"saved annulus.png, {width} x {height} pixels; --viewer-memory 96 MiB: too little for 1920x1080 pixels"),
                   f"the size of the file and the reason are said: {said}")
            shot(tab, "saved_fewer")
        expect(tab.run("document.getElementById('status').className") == "wrong", "it is shown as an error")
        tab.call("Page.navigate", url="about:blank")


def resize(tab, width, height, ratio=1, **more):
    """Gives the page another size, and waits for the final picture of that size."""
    tab.resize(width, height, ratio, **more)
    tab.wait(f"""window.innerWidth === {width} && (() => {{ const r = document.getElementById('stage').getBoundingClientRect();
      return Math.abs(r.width * {ratio} - {PAGE}.header.width) <= 1 && Math.abs(r.height * {ratio} - {PAGE}.header.height) <= 1; }})()""",
             f"the picture of a page of {width}x{height}")
    rest(tab)


def sizes(tab):
    rest(tab)
    first = tab.run(f"{PAGE}.state.camera.parallel_scale")
    widths = []
    for width, height, ratio in ((640, 480, 1), (390, 844, 2), (1920, 1080, RATIO), (1280, 800, RATIO)):
        resize(tab, width, height, ratio)
        shot(tab, f"size_{width}")
        expect(tab.run("getComputedStyle(document.getElementById('picture')).objectFit") == "contain", "a picture before is not stretched")
        stage = tab.run("(() => { const r = document.getElementById('stage').getBoundingClientRect(); return [r.width, r.height]; })()")
        header = tab.run(f"[{PAGE}.header.width, {PAGE}.header.height]")
        expect(all(abs(a * ratio - b) <= 1 for a, b in zip(stage, header)), f"a page of {width}x{height}: {stage}, {header}")
        # A narrow picture shows as much of the data's width as a usual one does, but for what its scalar bar takes.
        scale, usual = tab.run(f"[{PAGE}.state.camera.parallel_scale / Math.max(1, cache.shape / shapeOf()), cache.shape]")
        widths.append(scale)
        expect(max(widths) < 1.2 * min(widths), f"the data keep their width: {widths}, of a shape of {usual}")
    expect(abs(tab.run(f"{PAGE}.state.camera.parallel_scale") / first - 1) < 0.1, f"and come back as they were: {first}, {widths}")
    # A phone: one finger rotates, two zoom and move.
    resize(tab, 390, 844, 2, mobile=True)
    camera = tab.run(f"{PAGE}.state.camera")
    tab.touch("touchStart", (100, 150))
    for n in range(10):
        tab.touch("touchMove", (100 + 5 * n, 150))
    tab.touch("touchEnd")
    rest(tab)
    turned = tab.run(f"{PAGE}.state.camera")
    expect(turned["position"] != camera["position"] and turned["parallel_scale"] == camera["parallel_scale"], "a finger rotates")
    tab.touch("touchStart", (100, 150), (200, 150))
    for n in range(10):
        tab.touch("touchMove", (100 - 3 * n, 150), (200 + 3 * n, 150))
    tab.touch("touchEnd")
    rest(tab)
    shot(tab, "phone")
    expect(tab.run(f"{PAGE}.state.camera.parallel_scale") < 0.9 * turned["parallel_scale"], "two fingers zoom")
    resize(tab, 1280, 800, RATIO)


def undo_after_resizing(tab):
    """A window of another size is no step of undo; a view that comes back by undo is for the present size."""
    rest(tab)
    camera = tab.run(f"{PAGE}.state.camera")
    steps = tab.run("[statesAtRest.length, stateAtRest]")
    outline = tab.run(f"{PAGE}.state.outline")
    changes(tab, lambda: tab.click("#outline"), "the outline")
    resize(tab, 390, 844, 2)
    expect(tab.run("[statesAtRest.length, stateAtRest]") == [steps[1] + 2, steps[1] + 1], f"resizing adds no step to undo: {steps}")
    narrow = tab.run(f"{PAGE}.state.camera.parallel_scale")
    expect(narrow > 1.2 * camera["parallel_scale"], "the narrow picture's view is further away")
    tab.run("document.dispatchEvent(new KeyboardEvent('keydown', { key: 'z', ctrlKey: true }))")
    rest(tab)
    expect(tab.run(f"{PAGE}.state.outline") == outline, "Ctrl+Z undoes the outline")
    expect(abs(tab.run(f"{PAGE}.state.camera.parallel_scale") / narrow - 1) < 0.01, "in the view of the narrow picture")
    resize(tab, 1280, 800, RATIO)
    back = tab.run(f"{PAGE}.state.camera")
    expect(max(abs(a - b) for a, b in zip(back["position"], camera["position"])) < 0.01 * max(map(abs, camera["position"])), "and the view comes back")


CONTRASTS = """(() => {
  const parse = text => { const m = text.match(/[\\d.]+/g).map(Number); return [m[0], m[1], m[2], m.length > 3 ? m[3] : 1]; };
  const over = (a, b) => [0, 1, 2].map(i => a[3] * a[i] + (1 - a[3]) * b[i]).concat(1);
  const light = c => { const [r, g, b] = c.slice(0, 3).map(v => v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const ratio = (a, b) => { const [low, high] = [light(a), light(b)].sort((x, y) => x - y); return (high + 0.05) / (low + 0.05); };
  const behind = (e, picture) => { const chain = [];
    for (; e && e.id !== "stage"; e = e.parentElement) chain.unshift(parse(getComputedStyle(e).backgroundColor));
    return chain.reduce((below, c) => over(c, below), picture); };
  const low = [];
  let count = 0;
  for (const e of document.querySelectorAll("body *")) {
    const own = [...e.childNodes].some(n => n.nodeType === 3 && n.data.trim()) || e.matches("select, textarea, input[type=number]");
    if (!own || !e.getClientRects().length || e.matches("script, style, option")) continue;
    for (let a = e; a; a = a.parentElement) if (getComputedStyle(a).opacity !== "1") low.push([e.id || e.textContent, "is translucent"]);
    for (const picture of [[255, 255, 255, 1], [21, 23, 28, 1]]) {
      const paper = behind(e, picture), found = ratio(over(parse(getComputedStyle(e).color), paper), paper);
      ++count;
      if (found < 4.5) low.push([e.id || e.textContent.trim().slice(0, 30), found]);
    }
  }
  const hex = name => { const t = getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim().slice(1);
    return (t.length === 3 ? [...t].map(c => c + c) : t.match(/../g)).map(c => parseInt(c, 16)); };
  for (const [a, b, least] of [["numbers", "curve", 4.5], ["numbers", "bars", 4.5], ["accent", "curve", 3], ["accent", "bars", 3], ["point", "curve", 3],
      ["point", "bars", 3], ["iso", "curve", 3], ["iso", "bars", 3], ["accent", "panel", 3], ["accent", "field", 3]])
    if (ratio(hex(a), hex(b)) < least) low.push([a + " on " + b, ratio(hex(a), hex(b))]);
  return [count, low];
})()"""


def themes(browser, server):
    """Both themes: the system's, or the one that is chosen, which stays. Every text is read on what lies behind it."""
    tab = opened(browser, server.url)
    tab.run("localStorage.clear()")
    for system in ("dark", "light"):
        tab.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": system}])
        tab.wait(f"document.documentElement.dataset.theme === '{system}'", "the system's theme")
    tab.click("#light")
    expect(tab.run("document.documentElement.dataset.theme") == "dark", "the box chooses the other theme")
    tab.call("Page.reload")
    tab.wait(f"{PAGE} && {PAGE}.pictures > 0", "a picture after loading again")
    expect(tab.run("document.documentElement.dataset.theme") == "dark", "which stays")
    press(tab, "#add-iso")
    press(tab, "#add-clip")
    set_value(tab, "#clip", "on")
    rest(tab)
    tab.run("state.markers.push({ name: '1', scalar: 'f', unit: '', value: 1, point: [...cache.upper], block: 0, i: 0, j: 0, k: 0 }); showMarkers()")
    tab.run("document.querySelectorAll('details').forEach(d => { d.open = true; }); openMaps(true); openFaces(true)")
    tab.run("say('a message'); $('keys').showModal()")
    for theme in ("dark", "light"):
        if tab.run("document.documentElement.dataset.theme") != theme:
            press(tab, "#light")
        background = tab.run("getComputedStyle(document.getElementById('panel')).backgroundColor")
        expect(background == {"dark": "rgb(34, 38, 43)", "light": "rgb(246, 247, 248)"}[theme], f"the {theme} theme's panel: {background}")
        count, low = tab.run(CONTRASTS)
        expect(count > 200 and not low, f"contrasts of the {theme} theme, of {count} texts: {low}")
        shot(tab, f"theme_{theme}")
    tab.run("localStorage.clear()")
    tab.call("Emulation.setEmulatedMedia", features=[])
    tab.call("Page.navigate", url="about:blank")


def time_steps(browser, server):
    tab = opened(browser, server.url)
    rest(tab)
    tab.run("document.getElementById('cache').value = 1; document.getElementById('cache').onchange()")
    tab.wait("!document.getElementById('time').hidden", "the series")
    rest(tab)
    changes(tab, lambda: set_value(tab, "#step", "2"), "another step", "step")
    seen = set()
    tab.click("#play")
    wait_for(lambda: seen.add(tab.run(f"{PAGE}.header.step")) or len(seen) == 4, "all steps to be played")
    shot(tab, "playing")
    tab.click("#play")
    rest(tab)
    expect(tab.run(f"{PAGE}.errors.length") == 0, f"no errors: {tab.run(PAGE + '.errors')}")
    # Each cache comes back as it was left.
    step = tab.run(f"{PAGE}.header.step")
    tab.run("document.getElementById('cache').value = 0; document.getElementById('cache').onchange()")
    rest(tab)
    tab.run("document.getElementById('cache').value = 1; document.getElementById('cache').onchange()")
    tab.wait(f"{PAGE}.header.step === {step}", "the step that was left")


def lost_connection(browser, caches, folder):
    token = pathlib.Path(folder, "token")
    token.write_text("an-address-that-stays-0123456789\n")
    token.chmod(0o600)
    with serving(program, caches, "--token-file", str(token)) as server:
        tab = opened(browser, server.url)
        tab.drag(MIDDLE, (900, 450), steps=5)
        before = rest(tab)
        camera = tab.run(f"{PAGE}.state.camera")
        server.kill()
        tab.wait("!document.getElementById('status').hidden", "the page to say that the connection is lost")
        shot(tab, "lost")
        with serving(program, caches, "--token-file", str(token), port=server.port):
            tab.wait(f"{PAGE}.connections === 2", "the page to come back")
            tab.wait("document.getElementById('status').hidden", "the message to go")
            time.sleep(0.3)
            expect(rest(tab) == before, "the picture is the one before")
            expect(tab.run(f"{PAGE}.state.camera") == camera, "the camera is the one before")


def flying(tab):
    rest(tab)
    tab.run("document.getElementById('picture').focus()")
    tab.key("f")
    tab.wait(f"{PAGE}.state.camera.perspective", "flying to be in perspective")
    before = rest(tab)
    camera = tab.run(f"{PAGE}.state.camera")
    tab.call("Input.dispatchKeyEvent", type="keyDown", key="w", text="w")
    tab.wait(f"JSON.stringify({PAGE}.state.camera.position) !== JSON.stringify({camera['position']})", "w to move the viewer")
    time.sleep(0.3)
    tab.call("Input.dispatchKeyEvent", type="keyUp", key="w")
    flown = tab.run(f"{PAGE}.state.camera")
    ahead = [f - p for f, p in zip(camera["focal_point"], camera["position"])]
    way = [b - a for a, b in zip(camera["position"], flown["position"])]
    cosine = sum(a * w for a, w in zip(ahead, way)) / (sum(a * a for a in ahead) * sum(w * w for w in way)) ** 0.5
    expect(cosine > 0.9999, f"w flies forwards: {cosine}")
    expect(rest(tab) != before, "flying changes the picture")
    shot(tab, "flown")
    tab.drag(MIDDLE, (860, 400), steps=5)
    turned = tab.run(f"{PAGE}.state.camera")
    expect(turned["focal_point"] != flown["focal_point"], "while flying, a drag looks around")
    expect(all(abs(a - b) < 1e-9 for a, b in zip(turned["position"], flown["position"])), "and stays where it is")
    tab.key("f")
    tab.key("o")
    tab.key("r")
    rest(tab)
    expect(not tab.run(f"{PAGE}.state.camera.perspective"), "orthographic again")


def shared_address(browser, server, tab):
    """Another browser's page at the copied address shows the same picture: cache, step, camera and function."""
    tab.run("document.getElementById('cache').value = 1; document.getElementById('cache').onchange()")
    tab.wait("!document.getElementById('time').hidden", "the series")
    set_value(tab, "#step", "2")
    choose_map(tab, "magma")
    tab.wait("document.getElementById('map').textContent === 'magma'", "the colours")
    tab.drag(MIDDLE, (850, 430), steps=5)
    before = rest(tab)
    tab.run("document.getElementById('copy-address').click()")
    tab.wait("document.getElementById('copied').open", "the address")
    address = tab.run("document.getElementById('copied-text').value")
    shot(tab, "address")
    tab.run("document.getElementById('copied').close()")
    expect(address.startswith(server.url + "#"), f"the address is the server's: {address[:80]}")
    print(f"an address of {len(address)} characters")
    expect(len(address) < 1500, f"the address is short: {len(address)} characters")
    other = opened(browser, address)
    expect(rest(other) == before, "the same picture")
    expect(other.run("[cache.name, step, strip]") == tab.run("[cache.name, step, strip]"), "the same cache, step and colours")
    # Each view leaves its address, so that a page that is loaded again shows what it showed.
    tab.call("Page.reload")
    tab.wait(f"{PAGE} && {PAGE}.pictures > 0", "a picture after loading again")
    expect(rest(tab) == before, "loaded again, the page shows the same")
    # In a page that is open, an address typed over the other one is shown, too.
    tab.run("document.getElementById('fit').click()")
    wait_for(lambda: rest(tab) != before, "another view")
    tab.run("keepAddress()")  # which is made after the picture
    other.run(f"location.hash = {tab.run('location.hash')!r}")
    wait_for(lambda: rest(other) == rest(tab), "the page to follow its address")
    # One that was cut off says so.
    cut = opened(browser, address[:-40])
    expect("not whole" in cut.run(f"{PAGE}.errors.join()"), "an address that was cut off is named")
    expect(cut.run("cache.name") == "annulus", "and the first view is shown")
    for one in (other, cut):
        one.call("Page.navigate", url="about:blank")
    tab.run("document.getElementById('cache').value = 0; document.getElementById('cache').onchange()")
    tab.wait("cache.name === 'annulus'", "the first cache")
    expect(tab.run(f"{PAGE}.errors.length") == 0, f"no errors: {tab.run(PAGE + '.errors')}")


def markers(tab):
    """A click finds what is seen there; its sign follows the camera."""
    tab.run(f"{PAGE}.state.markers.length = 0")
    tab.key("z")
    rest(tab)
    # Somewhere the data are.
    for x, y in ((800, 400), (760, 300), (700, 300), (860, 300), (700, 500)):
        tab.mouse("mousePressed", x, y, buttons=1)
        tab.mouse("mouseReleased", x, y)
        try:
            wait_for(lambda: tab.run(f"{PAGE}.state.markers.length"), "a marker", 10)
            break
        except AssertionError:
            pass
    else:
        expect(False, "a click into the data makes a marker")
        return
    marker = tab.run(f"{PAGE}.state.markers[0]")
    # A mouse that rests there is told the same value; where there is nothing, it is told nothing.
    shown = "document.getElementById('hover').hidden ? '' : document.getElementById('hover').textContent"
    tab.mouse("mouseMoved", x + 1, y, button="none")
    tab.mouse("mouseMoved", x, y, button="none")
    text = tab.wait(shown, "the value under the mouse")
    shot(tab, "hover")
    expect(text.split()[0] == marker["scalar"] and abs(float(text.split()[1]) - marker["value"]) <= 1e-3 * abs(marker["value"]) + 1e-9,
           f"the value under the mouse: {text}, not {marker['value']}")
    tab.mouse("mouseMoved", 1275, 795, button="none")
    expect(tab.run(shown) == "", "the value goes with the mouse")
    tab.wait("hovered && hovered.answered", "an answer for the corner")
    expect(tab.run(shown) == "" and len(tab.run(f"{PAGE}.state.markers")) == 1, "there is nothing in the corner")
    tab.mouse("mousePressed", 1275, 795, buttons=1)
    tab.mouse("mouseReleased", 1275, 795)
    tab.wait("document.getElementById('status').textContent === 'There is nothing at this place.'", "a click there to be answered")
    expect(tab.run(f"{PAGE}.errors.length === 0 && document.getElementById('status').className === ''"), "which is no error")
    late_click(tab, x, y)
    slow_decoding(tab)
    expect(marker["name"] == "1" and marker["value"] == marker["value"] and len(marker["point"]) == 3, f"a marker: {marker}")
    sign_text = tab.run("document.querySelector('.sign').textContent")
    value = tab.run("document.querySelector('#markers .value').textContent")
    places = tab.run("[...document.querySelectorAll('#markers .place')].map(e => e.textContent)")
    expect(len(places) == 1 and places[0].startswith("x ") and ", z " in places[0], f"its place is in the list: {places}")
    expect(sign_text.startswith(f"1: {marker['scalar']} ") and value.startswith(f"{marker['scalar']} "), f"its texts name its scalar: {sign_text}, {value}")
    tab.click("#markers input")
    tab.run("document.querySelector('#markers input').select()")
    for letter in "zip":  # of a text, not keys of the page: z looks from above
        tab.key(letter)
    tab.key("\r")
    wait_for(lambda: tab.run("document.querySelector('.sign').textContent").startswith(f"zip: {marker['scalar']} "), "the sign with the marker's text")
    tab.run("document.activeElement.blur()")
    sign = "(() => { const r = document.querySelector('.sign').getBoundingClientRect(); return [r.x, r.y + r.height / 2]; })()"
    left, middle = tab.run(sign)
    expect(abs(left - 8 - x) < 4 and abs(middle - y) < 4, f"its sign is at the click: {left - 8}, {middle}, not {x}, {y}")
    tab.drag((600, 400), (640, 420), modifiers=8)
    rest(tab)
    moved = tab.run(sign)
    expect(abs(moved[0] - left - 40) < 4 and abs(moved[1] - middle - 20) < 4, f"it moves with the data: {moved}, from {[left, middle]}")
    shot(tab, "marker")
    # A second one, and how far it is from the first.
    tab.run("window.further = point => { const { name, ...one } = state.markers[0]; onMarker({ cache: cache.cache, marker: { ...one, point } }); }")
    tab.run("further(add(state.markers[0].point, [2, 3, 6]))")
    expect(tab.run("document.querySelector('#markers .distance').textContent") == "distance zip to 1: 7", "the distance between two")
    # Another one right of the first, whose text would lie on its dot.
    tab.run("state.camera.parallel_scale *= 4; changed()")
    rest(tab)
    tab.run("further(add(state.markers[0].point, times(0.04 * state.camera.parallel_scale, axesOf(state.camera).right)))")
    under = tab.run("""[...document.querySelectorAll('.sign')].flatMap(sign => [...document.querySelectorAll('.sign')].filter(other => {
      const text = sign.getBoundingClientRect(), all = document.getElementById('signs').getBoundingClientRect();
      const x = all.left + parseFloat(other.style.left) / 100 * all.width, y = all.top + parseFloat(other.style.top) / 100 * all.height;
      return text.left < x && x < text.right && text.top < y && y < text.bottom; }).map(other => sign.textContent + ' on ' + other.textContent))""")
    shot(tab, "markers")
    expect(under == [], f"no text lies on a marker's dot: {under}")
    # Each is a step of undo, and so is the camera that was moved between them.
    names = "state.markers.map(one => one.name).join()"
    steps = [tab.run(names)]
    for _ in range(3):
        press(tab, "#undo")
        steps.append(tab.run(names))
        rest(tab)
    expect(steps == ["zip,1,2", "zip,1", "zip,1", "zip"], f"markers are undone one by one: {steps}")
    tab.run("document.querySelector('#markers button').click()")
    expect(tab.run(f"{PAGE}.state.markers.length") == 0 and not tab.run("Boolean(document.querySelector('.sign'))"), "a marker is removed")


def slow_decoding(tab):
    """A picture that is decoded after the next one does not take its place."""
    tab.run("window.late = []; window.draws = onPicture; onPicture = data => { late.push(data); return draws(data); }; zoom(state.camera, 1.01); changed()")
    rest(tab)
    before = tab.run(f"{PAGE}.pictures")
    tab.run("""onPicture = draws; window.decode = createImageBitmap; window.isFirst = true; createImageBitmap = async blob => {
      if (isFirst) { isFirst = false; await new Promise(done => { window.letFirst = done; }); }
      return decode(blob); }; onPicture(late.at(-1)); onPicture(late.at(-1)); 0""")
    tab.wait(f"{PAGE}.pictures === {before} + 1", "the second picture")
    tab.run("createImageBitmap = decode; letFirst(); new Promise(done => setTimeout(done, 100))")
    expect(tab.run(f"{PAGE}.pictures") == before + 1, "the first one is left out")
    tab.run("zoom(state.camera, 1 / 1.01); changed()")
    rest(tab)


def late_click(tab, x, y):
    """A click while the picture is older than the controls, which the page says: its marker follows."""
    status, work = ("document.getElementById('status').textContent", "!document.getElementById('work').hidden")
    for moves in (False, True):
        rest(tab)
        count = len(tab.run(f"{PAGE}.state.markers"))
        tab.run("window.late = []; window.draws = onPicture; onPicture = data => late.push(data); document.getElementById('outline').click()")
        tab.mouse("mousePressed", x, y, buttons=1)
        tab.mouse("mouseReleased", x, y)
        tab.wait(f"{status} === 'a marker follows when the picture is final'", "the click to be answered")
        expect(tab.wait(f"{work} && document.getElementById('work').textContent", "what is done") == "drawing ...", "the page draws")
        shot(tab, "drawing")
        if moves:
            tab.run("zoom(state.camera, 1.01); changed()")
            tab.wait(f"{status} === 'No marker was set, because the view has changed since the click.'", "the lost click to be named")
        tab.run("onPicture = draws; late.forEach(onPicture)")
        if not moves:
            tab.wait(f"{PAGE}.state.markers.length === {count + 1}", "the marker")
            expect(tab.run(f"{status}") == "", "the message goes")
        rest(tab)
        expect(len(tab.run(f"{PAGE}.state.markers")) == count + (not moves) and not tab.run(work), "the picture is final")
        tab.run(f"{PAGE}.state.markers.length = {count}; showMarkers(); zoom(state.camera, {1 / 1.01 if moves else 1}); changed()")
    rest(tab)


def two_scalars(tab):
    names = tab.run("[...document.getElementById('opacity_by').options].map(o => o.value)")
    changes(tab, lambda: set_value(tab, "#opacity_by", names[1]), "another scalar's opacities", "two_scalars")
    expect(tab.run(f"{PAGE}.state.opacity_by.variable") == names[1], "the opacities are the other scalar's")
    own = tab.run(f"{PAGE}.state.function.Points")
    shown = "[document.getElementById('edits').value, document.getElementById('opacities-row').hidden]"
    expect(tab.run(shown) == ["opacities", False], f"the opacities that have an effect are edited: {tab.run(shown)}")
    tab.run("$('edits').value = 'colours'; $('edits').onchange()")
    expect(tab.run(shown) == ["colours", True], "no opacities are edited that have no effect")
    tab.run("openNamed(cache.name)")  # as after a reload
    tab.wait("$('edits').value === 'opacities'", "the opacities again")
    changes(tab, lambda: set_value(tab, "#unit", "0.05"), "the other function's opacity unit")
    expect(tab.run(f"{PAGE}.state.opacity_by.function.ScalarOpacityUnitDistance") == 0.05, "the other function is edited")
    expect(tab.run(f"{PAGE}.state.function.Points") == own, "the colours' function is as it was")
    changes(tab, lambda: set_value(tab, "#opacity_by", ""), "the same scalar again")
    expect(tab.run(f"{PAGE}.state.opacity_by") is None, "one scalar again")
    # Isosurfaces of another scalar are drawn beside the volume, whose opacities stay.
    tab.run("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    alone = rest(tab)
    changes(tab, lambda: press(tab, "#add-iso"), "an isosurface")
    own = rest(tab)
    changes(tab, lambda: press(tab, "#add-iso"), "another one")
    changes(tab, lambda: set_value(tab, "#isosurfaces > :last-child select", names[1]), "its scalar", "other_isosurface")
    expect(tab.run(f"{PAGE}.state.opacity_by") is None and rest(tab) not in (alone, own), "both are drawn, with the volume's opacities")
    for _ in range(2):
        changes(tab, lambda: press(tab, "#isosurfaces button:last-of-type"), "one isosurface less")
    expect(rest(tab) == alone, "the volume is as before")
    # Another scalar's function is chosen from its own values, also after this one's was edited; the colours stay.
    first = tab.run(f"{PAGE}.state.variable")
    automatic = {}
    for name in (names[1], first):
        changes(tab, lambda name=name: set_value(tab, "#scalar", name), f"the scalar {name}")
        automatic[name] = tab.run(f"{PAGE}.state.function")
    press(tab, "#band")
    set_value(tab, "#unit", "1e-6")
    choose_map(tab, "magma")
    tab.wait("document.getElementById('map').textContent === 'magma'", "the colours")
    changes(tab, lambda: set_value(tab, "#scalar", names[1]), "another scalar after an edit", "another_scalar")
    tab.wait("document.getElementById('map').textContent === 'magma'", "the colours again")
    found = tab.run(f"{PAGE}.state.function")
    expect(found["Points"] == automatic[names[1]]["Points"] and found["ScalarOpacityUnitDistance"] == automatic[names[1]]["ScalarOpacityUnitDistance"],
           "an edited function is chosen anew for another scalar")
    # So do those that a person chose when the opacities are chosen from the data; "automatic" in the list gives them up.
    press(tab, "#band")
    press(tab, "#automatic")
    wait_for(lambda: tab.run(f"{PAGE}.state.function.Points") == automatic[names[1]]["Points"], "the automatic opacities")
    tab.wait("document.getElementById('map').textContent === 'magma'", "the colours that were chosen")
    choose_automatic(tab)
    tab.wait("document.getElementById('map').textContent !== 'magma'", "the data's colours")
    changes(tab, lambda: set_value(tab, "#scalar", first), "the first scalar")
    # A marker keeps the scalar that it was set in.
    tab.key("z")
    rest(tab)
    for place in ((800, 400), (760, 300), (700, 300), (860, 300), (700, 500)):
        if not tab.run(f"{PAGE}.state.markers.length"):
            tab.mouse("mousePressed", *place, buttons=1)
            tab.mouse("mouseReleased", *place)
            wait_for(lambda: tab.run(f"{PAGE}.state.markers.length || document.getElementById('status').textContent.startsWith('There is nothing')"), "an answer")
            tab.run("say('')")
    text = tab.run("document.querySelector('.sign').textContent")
    changes(tab, lambda: set_value(tab, "#scalar", names[1]), "another scalar", "marker_of_another_scalar")
    expect(f" {tab.run(PAGE + '.state.markers[0].scalar')} " in text, f"a sign names its scalar: {text}")
    expect(tab.run("document.querySelector('.sign').textContent") == text, f"under another scalar it is still {text}")
    expect(tab.run(f"{PAGE}.errors.length") == 0, f"no errors: {tab.run(PAGE + '.errors')}")


def reversed_floats(data):
    """Another scalar of the same grid."""
    return b"".join(data[n:n + 4] for n in range(len(data) - 4, -4, -4))


def swipes(tab):
    """A finger that swipes over the curve scrolls, and one that taps adds a point, which a button undoes."""
    tab.run("setPoints([[0, 0], [1, 0.04]].map(([u, opacity]) => ({ u, opacity, midpoint: 0.5, sharpness: 0 }))); changed()")
    rest(tab)
    tab.run("document.getElementById('curve').scrollIntoView({ block: 'center' })")
    x, y = tab.place("#curve")
    scrolled = "document.getElementById('panel').scrollTop"
    before, points = tab.run(scrolled), tab.run("state.function.Points")
    tab.touch("touchStart", (x, y - 30))
    for n in range(1, 9):
        tab.touch("touchMove", (x, y - 30 - 12 * n))
    tab.touch("touchEnd")
    expect(tab.run("state.function.Points") == points, "a swipe over the curve adds no point")
    wait_for(lambda: tab.run(scrolled) > before, "a swipe over the curve to scroll the panel", 20)
    tab.run("document.getElementById('curve').scrollIntoView({ block: 'center' })")
    x, y = tab.place("#curve")
    tab.touch("touchStart", (x, y - 30))
    tab.touch("touchEnd")
    wait_for(lambda: tab.run("points().length") == 3, "a tap to add a point", 20)
    rest(tab)
    tab.run("document.getElementById('undo').click()")
    expect(tab.run("points().length") == 2, "a button undoes it")


def phone(browser, server):
    """On a phone nothing is wider than the page, and a finger finds what it is to press."""
    wide = opened(browser, server.url)
    usual = wide.run(f"distance({PAGE}.state.camera)")
    wide.call("Page.navigate", url="about:blank")
    tab = opened(browser, server.url, (390, 844))
    expect(tab.run(f"distance({PAGE}.state.camera)") > 1.5 * usual, "the first view has the data's width in a narrow picture")
    shot(tab, "phone_first")
    tab.run("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    tab.run("document.getElementById('add-slice').click()")
    tab.run("state.markers.push({ name: '1', scalar: 'f', unit: '', value: 1, point: [...cache.upper], block: 0, i: 0, j: 0, k: 0 }); showMarkers()")
    rest(tab)
    wrong = tab.run("""[...document.querySelectorAll('button, select, input, summary')]
      .map(e => e.closest('.check') || e).filter(e => e.offsetParent)
      .map(e => [e.id || e.textContent.trim() || e.outerHTML.slice(0, 60), e.getBoundingClientRect()])
      .filter(([name, r]) => r.left < 0 || r.right > 390 || r.height < 44 || r.width < 44)
      .map(([name, r]) => `${name}: ${r.width} x ${r.height} at ${r.left}`)""")
    expect(not wrong, f"targets of 44 pixels within the page: {wrong}")
    expect(tab.run("document.getElementById('panel').scrollWidth <= document.getElementById('panel').clientWidth"), "nothing is cropped")
    shot(tab, "phone")
    tab.run("document.getElementById('panel').scrollTop = 330")
    shot(tab, "phone_scrolled")
    tab.run("document.getElementById('keys').showModal()")
    wide_columns = tab.run("""[...document.querySelectorAll('#keys td')].map(e => e.getBoundingClientRect().width)
      .every(width => width > 0.3 * document.getElementById('keys').clientWidth)""")
    expect(wide_columns, "keys and what they do both have space")
    expect(tab.run("document.getElementById('keys').scrollTop") == 0, "the list begins at its top")
    shot(tab, "phone_keys")
    tab.run("document.getElementById('keys').close()")
    swipes(tab)
    # Its whole label switches a box.
    before = tab.run("document.getElementById('outline').checked")
    tab.run("document.getElementById('outline').closest('label').click()")
    expect(tab.run("document.getElementById('outline').checked") != before, "a label switches its box")
    tab.call("Page.navigate", url="about:blank")


def wrong_token(browser, server):
    tab = browser.tab(server.url[:-1] + ("0" if server.url[-1] != "0" else "1"))
    tab.wait("document.body && document.body.textContent.includes('token is wrong')", "the refusal")
    shot(tab, "wrong_token")
    expect(not tab.run(f"Boolean({PAGE})"), "a wrong token gets no page")
    # A page that is not the server's cannot connect, even with the token.
    refused = browser.tab().run(f"""new Promise(done => {{
      const s = new WebSocket("ws://{server.host}/socket?token={server.token}");
      s.onopen = () => done("open"); s.onerror = () => done("refused"); }})""")
    expect(refused == "refused", f"another page's socket: {refused}")


def as_many_clients_as_may_be(browser, caches):
    clients = 10 if IS_WHOLE else 2
    with serving(program, caches, "--viewer-memory", "128M", "--memory", f"{128 * clients}M") as server:
        tabs = [browser.tab(server.url, (480, 360)) for _ in range(clients)]  # each in a window: hidden pages ask for nothing
        for n, tab in enumerate(tabs):
            tab.wait(f"{PAGE} && {PAGE}.pictures > 0", f"client {n}'s picture")
        refused = browser.tab(server.url, (480, 360))
        refused.wait("document.getElementById('status') && document.getElementById('status').textContent.includes('as many viewers')", "one more to be told")
        shot(refused, "refused")
        for n, tab in enumerate(tabs):
            tab.run(f"{PAGE}.state.camera.parallel_scale *= {1 + 0.05 * n}; window.dispatchEvent(new Event('nothing'))")
            tab.drag((390, 150), (420 + 2 * n, 160), steps=4)
        sums = {rest(tab) for tab in tabs}
        expect(len(sums) == clients, f"{clients} clients have as many views: {len(sums)}")
        threads = server.threads()
        print(f"{clients} clients: {server.kilobytes()} kB, {threads} threads")
        for tab in tabs + [refused]:
            tab.call("Page.navigate", url="about:blank")
        wait_for(lambda: server.threads() <= threads - clients, "the viewers to end")
        print(f"without clients: {server.threads()} threads")


def serves_a_grid(folder):
    os.environ["XDG_CACHE_HOME"] = f"{folder}/kept"
    with serving(program, [f"{folder}/annulus.splats", f"{folder}/g.xyz", f"{folder}/g.fun"]) as server:
        names = Viewer(server).hello["caches"]
        expect(names == ["annulus", "g"], f"a grid is served as its cache, beside another one: {names}")


def thumbnails(browser, caches):
    """The list of caches has a picture of each, while the view stays; a click opens one."""
    with serving(program, caches) as server:
        tab = opened(browser, server.url)
        before = rest(tab)
        pixels = """[...document.querySelectorAll('#thumbnails canvas')].map(c =>
          c.getContext('2d').getImageData(0, 0, 240, 150).data.reduce((a, b) => (a * 31 + b) % 1000003, 0))"""
        expect(tab.run(pixels) == [0, 0], "no thumbnail is drawn before the list is open")
        tab.run("document.querySelector('#gallery summary').click()")
        tab.wait("withoutThumbnail.size === 0", "two thumbnails")
        expect(rest(tab) == before, "the view is as it was")
        expect(tab.run("document.getElementById('title').textContent") == "annulus", "its cache, too")
        first, second = tab.run(pixels)
        expect(first != second and first and second, f"two caches have two pictures: {first}, {second}")
        shot(tab, "thumbnails")
        changes(tab, lambda: tab.run("document.querySelectorAll('#thumbnails button')[1].click()"), "the other cache")
        expect(tab.run("document.getElementById('title').textContent") == "wake", "a click opens the other cache")
        expect(server.stop() == 130, "Ctrl-C ends the server")


def page_without_server(browser, folder):
    """What `render -o NAME.html` writes: dragged, by keys, by its slider, and played; and that it loads nothing."""
    page = pathlib.Path(folder, "turntable.html")
    subprocess.run([program, "render", f"{folder}/annulus.splats", "-o", page, "--orbit", "360", "--frames", "8", "--size", "400x300"],
                   check=True, capture_output=True)
    tab = browser.tab(page.as_uri(), (800, 600))
    shown = "[...document.images].findIndex(i => getComputedStyle(i).display !== 'none')"
    tab.wait("document.readyState === 'complete' && document.images.length === 8", "the page's pictures")
    expect(tab.run("[...document.images].every(i => i.naturalWidth === 400 && i.naturalHeight === 300)"), "all pictures are decoded")
    expect(tab.run(shown) == 0 and tab.run("[...document.images].filter(i => getComputedStyle(i).display !== 'none').length") == 1,
           "the first picture is shown, alone")
    tab.drag((400, 150), (500, 150))  # a quarter of the picture's width
    expect(tab.run(shown) == 2, f"dragging turns by two of eight pictures: {tab.run(shown)}")
    tab.drag((500, 150), (250, 150))
    expect(tab.run(shown) == 5, f"dragging back goes beyond the first: {tab.run(shown)}")
    set_value(tab, "#frame", "3")
    expect(tab.run(shown) == 3 and tab.run("document.getElementById('number').value") == "4 / 8", "the slider chooses")
    tab.run("document.getElementById('play').click()")
    tab.wait(f"{shown} !== 3", "the page to play")
    expect(tab.run("performance.getEntriesByType('resource').filter(r => !r.name.startsWith('data:')).length") == 0, "the page loads nothing")
    shot(tab, "turntable")


with tempfile.TemporaryDirectory() as folder:
    subprocess.run([program, "generate", "half-annulus", "--size", "36x24x18", "-o", f"{folder}/g"], check=True, capture_output=True)
    subprocess.run([program, "convert", f"{folder}/g.xyz", f"{folder}/g.fun", "-o", f"{folder}/annulus.splats"], check=True, capture_output=True)
    subprocess.run([program, "generate", "wake", "--size", "32x24x16", "--steps", "4", "-o", f"{folder}/w"], check=True, capture_output=True)
    subprocess.run([program, "convert", f"{folder}/w.xyz", f"{folder}/w_*.fun", "-o", f"{folder}/wake.splats"], check=True, capture_output=True)
    # Two scalars.
    one = pathlib.Path(folder, "g.fun").read_bytes()
    pathlib.Path(folder, "two.fun").write_bytes(one[:12] + b"\2\0\0\0" + one[16:] + reversed_floats(one[16:]))
    subprocess.run([program, "convert", f"{folder}/g.xyz", f"{folder}/two.fun", "-o", f"{folder}/two.splats"], check=True, capture_output=True)
    caches = [f"{folder}/annulus.splats", f"{folder}/wake.splats"]
    browser = Chromium()
    try:
        with serving(program, caches) as server:
            tab = navigation(browser, server, caches)
            print("navigation done")
            editing(tab)
            print("editing done")
            if IS_WHOLE:
                copies_the_command(tab, caches, edited=False)
            copies_the_command(tab, caches, edited=True)
            choose_automatic(tab)
            choose_map(tab, "viridis")
            tab.wait("document.getElementById('map').textContent === 'viridis'", "the colours")
            copies_the_command(tab, caches, edited=False, colours="viridis")
            tab.run("setRange(...range(), false, null)")  # on a linear scale from now on
            choose_map(tab, "magma")
            tab.wait("document.getElementById('map').textContent === 'magma'", "the colours")
            tab.run("setPoints([[0, 0.2], [0.3, 0.9], [1, 0.1]].map(([u, opacity]) => ({ u, opacity, midpoint: 0.5, sharpness: 0 }))); changed()")
            if IS_WHOLE:
                copies_the_command(tab, caches, edited=False, colours="magma")
            choose_automatic(tab)
            asinh_scale(tab, caches)
            saves_pictures(tab)
            print("command done")
            markers(tab)
            print("markers done")
            flying(tab)
            print("flying done")
            sizes(tab)
            undo_after_resizing(tab)
            print("sizes done")
            themes(browser, server)
            print("themes done")
            shared_address(browser, server, tab)
            print("shared address done")
            time_steps(browser, server)
            print("time steps done")
            phone(browser, server)
            print("phone done")
            wrong_token(browser, server)
            expect(server.stop() == 130, "Ctrl-C ends the server with pages open")
        with serving(program, [f"{folder}/two.splats"]) as server:
            two_scalars(opened(browser, server.url))
            print("two scalars done")
        lost_connection(browser, caches, folder)
        print("lost connection done")
        as_many_clients_as_may_be(browser, caches)
        serves_a_grid(folder)
        thumbnails(browser, caches)
        saves_what_it_says(browser, caches)
        print("thumbnails done")
        page_without_server(browser, folder)
        print("page without a server done")
    finally:
        browser.close()

print(f"{len(failures)} failures")
sys.exit(1 if failures else 0)
