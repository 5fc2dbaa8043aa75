"""Opens report pages in headless Chromium and uses them: python3 check_page.py OUT... [--pictures DIR]

For every folder: the page loads without a word in the console and without a network request, is under 4 MB, the 3-D view
shows something, a click on the model chooses the piece under it and lights up its partners and its part, the keyboard
reaches everything, the replay runs, every step of the assembly shows, colours have contrast, nothing is wider than a phone,
and on one fingers turn the model and bring it nearer.
"""

import sys
from pathlib import Path

from browser import Browser

LARGEST = 4_000_000


def require(holds, what):
    if not holds:
        raise AssertionError(what)


def shown_share(browser):
    """Share of the pixels of the 3-D view that are not background."""
    return browser.run(
        """(() => {
          fabricate.viewer.draw();
          const from = document.getElementById("canvas");
          const copy = Object.assign(document.createElement("canvas"), { width: 200, height: 200 });
          const context = copy.getContext("2d");
          context.drawImage(from, 0, 0, 200, 200);
          const pixels = context.getImageData(0, 0, 200, 200).data;
          let shown = 0;
          for (let i = 3; i < pixels.length; i += 4) shown += pixels[i] > 0;
          return shown / 40000;
        })()"""
    )


def check_meshes(browser):
    for name in browser.run("fabricate.meshes.map((it) => it.name)"):
        browser.run(f"fabricate.showMesh('{name}')")
        browser.settle()
        share = shown_share(browser)
        require(0.02 < share < 0.98, f"mesh {name}: {share:.3f} of the view is covered")
        for coloring in browser.run("[...document.getElementById('color').options].map((it) => it.value)"):
            browser.run(f"fabricate.paint('{coloring}')")
            browser.settle()


def check_choice(browser):
    """A click on the model chooses the piece that is there, in all views."""
    if not browser.run("fabricate.meshes.some((it) => it.name === 'cut') && fabricate.seams.length > 0"):
        return
    browser.run("fabricate.showMesh('cut')")
    browser.run("document.getElementById('home').click()")
    browser.run("document.getElementById('work').scrollIntoView()")
    browser.settle()
    # Some place on the model, found by the same ray that a click uses, and what ought to be chosen there.
    x, y, piece = browser.run(
        """(() => {
          const box = document.getElementById("canvas").getBoundingClientRect();
          for (let j = 1; j < 20; j++) for (let i = 1; i < 20; i++) {
            const face = fabricate.viewer.pick((2 * i) / 20 - 1, 1 - (2 * j) / 20);
            if (face < 0) continue;
            const piece = fabricate.mesh.pieces[fabricate.mesh.corners(face)[0]];
            if (fabricate.partners(piece).size > 0 || fabricate.seamsOf(piece).length > 0)
              return [box.left + (box.width * i) / 20, box.top + (box.height * j) / 20, piece];
          }
          return [0, 0, -1];
        })()"""
    )
    require(piece >= 0, "no piece lies in the view")
    browser.click(x, y)
    require(browser.run("fabricate.selected") == piece, f"a click at ({x}, {y}) should choose piece {piece}")
    partners = set(browser.run(f"[...fabricate.partners({piece})]"))
    states = browser.run("[...fabricate.viewer.states].slice(1)")
    for other, state in enumerate(states):
        expected = 1 if other == piece else 2 if other in partners else 3
        require(state == expected, f"piece {other} is shown as {state}, not as {expected}")
    name = browser.run(f"document.querySelectorAll('.chip')[{piece}].textContent")
    parts = browser.run("document.querySelectorAll('.part.selected').length")
    if browser.run(f"fabricate.views.some((v) => v.parts.some((p) => p.piece === {piece}))"):
        require(parts == 1, f"{parts} parts are lit for piece {name}")
        require(browser.run("document.querySelector('.part.selected').dataset.name") == name, "the wrong part is lit")
        lit = browser.run("document.querySelectorAll('.part.partner').length")
        require((lit > 0) == (len(partners) > 0), "the parts of the partners are not lit")
        # The two sides of every seam of a whole job are marked on the sheets, where its parts lie.
        marks = browser.run("document.querySelectorAll('.marks .seam').length")
        require(marks > 0, "no seam is marked on the sheet")
    require(f"Piece {name}" in browser.run("document.getElementById('details').textContent"), "nothing is said of the piece")
    browser.key("Escape", 27)
    require(browser.run("fabricate.selected") == -1, "Escape clears the choice")
    check_sheet_click(browser)


def check_sheet_click(browser):
    """A click on a part of the sheet in view chooses its piece in the model."""
    place = browser.run(
        """(() => {
          const view = fabricate.views[fabricate.sheet ?? 0];
          if (!view) return null;
          for (const part of view.parts) {
            if (part.piece < 0) continue;
            const box = part.shape.getBoundingClientRect();
            for (let j = 1; j < 30; j++) for (let i = 1; i < 30; i++) {
              const [x, y] = [box.left + (box.width * i) / 30, box.top + (box.height * j) / 30];
              if (document.elementFromPoint(x, y) === part.shape) return [x, y, part.piece];
            }
          }
          return null;
        })()"""
    )
    if place is None:
        return
    browser.click(place[0], place[1])
    require(browser.run("fabricate.selected") == place[2], "a click on a part chooses its piece")
    browser.run("fabricate.select(-1)")


def check_camera(browser):
    before = browser.run("[...fabricate.viewer.camera.eye()]")
    browser.run("document.getElementById('canvas').focus()")
    for name, code in [("ArrowLeft", 37), ("ArrowUp", 38), ("+", 187)]:
        browser.key(name, code)
        after = browser.run("[...fabricate.viewer.camera.eye()]")
        require(before != after, f"key {name} does not move the view")
        before = after
    for key in ["explode", "unroll"]:
        if not browser.run(f"document.getElementById('{key}').closest('label').hidden"):
            browser.run(f"(() => {{ const it = document.getElementById('{key}'); it.value = 60; it.dispatchEvent(new Event('input')); }})()")
            browser.settle()
            require(browser.run(f"fabricate.viewer.{key}") > 0.5, f"the slider {key} does nothing")
            browser.run(f"(() => {{ const it = document.getElementById('{key}'); it.value = 0; it.dispatchEvent(new Event('input')); }})()")
    browser.run("document.getElementById('home').click()")


def check_touch(browser):
    """One finger turns the model, two bring it nearer."""
    browser.run("document.getElementById('canvas').scrollIntoView({ block: 'center' })")
    browser.settle()
    x, y = browser.run(
        """(() => {
          const box = document.getElementById("canvas").getBoundingClientRect();
          return [box.left + box.width / 2, box.top + box.height / 2];
        })()"""
    )
    eye = lambda: browser.run("[...fabricate.viewer.camera.eye()]")
    distance = lambda: browser.run("fabricate.viewer.camera.distance")
    before, far = eye(), distance()
    browser.touch([(x + 10 * k, y) for k in range(6)])
    require(eye() != before, "a finger does not turn the model")
    require(abs(distance() / far - 1) < 1e-6, "a finger changes the distance")
    browser.touch([(x - 20 - 8 * k, y) for k in range(6)], [(x + 20 + 8 * k, y) for k in range(6)])
    require(distance() < 0.9 * far, f"two fingers apart do not bring the model nearer: {distance()} after {far}")
    browser.run("document.getElementById('home').click()")


def check_replay(browser):
    if not browser.run("fabricate.views.some((it) => it.replay)"):
        return
    for value in [1, 400, 999]:
        browser.run(f"(() => {{ const it = document.getElementById('time'); it.value = {value}; it.dispatchEvent(new Event('input')); }})()")
        browser.settle()
        require(browser.run("fabricate.views[fabricate.sheet].replay.time") is not None, "the replay shows a time")
        drawn = browser.run(
            """(() => {
              const it = fabricate.views[fabricate.sheet].over;
              return it.getContext("2d").getImageData(0, 0, it.width, it.height).data.some((x) => x > 0);
            })()"""
        )
        require(drawn, f"nothing is drawn at {value / 10} % of the replay")
    seconds = browser.run("fabricate.views.reduce((sum, it) => sum + (it.replay?.seconds ?? 0), 0)")
    told = browser.run("JSON.parse(document.getElementById('report').textContent).route.seconds_estimate")
    require(abs(seconds - told) <= 0.02 * told, f"the replay takes {seconds:.0f} s, the report says {told:.0f} s")


def check_assembly(browser):
    count = browser.run("document.querySelectorAll('.step').length")
    for step in range(count):
        browser.run(f"fabricate.showStep({step})")
        browser.settle()
        visible = browser.run("[...fabricate.viewer.states].slice(1).filter((it) => it !== 4).length")
        require(visible == step + 1, f"step {step + 1} shows {visible} pieces")
    browser.run("fabricate.showStep(null)")


CONTRAST = """(() => {
  const parse = (text) => text.match(/[\\d.]+/g).map(Number);
  const light = ([r, g, b]) => [r, g, b].map((it) => it / 255).map((it) => (it <= 0.04045 ? it / 12.92 : ((it + 0.055) / 1.055) ** 2.4))
    .reduce((sum, it, k) => sum + it * [0.2126, 0.7152, 0.0722][k], 0);
  const ground = (it) => {
    for (; it; it = it.parentElement) {
      const color = parse(getComputedStyle(it).backgroundColor);
      if (color.length < 4 || color[3] > 0.5) return color;
    }
    return [255, 255, 255];
  };
  const low = [];
  for (const it of document.querySelectorAll("header *, main button, main p, main td, main th, main label, main summary, main h2, footer")) {
    const own = [...it.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
    const box = it.getBoundingClientRect();
    if (!own || box.width === 0 || it.closest("#labels, svg")) continue;
    const [a, b] = [light(parse(getComputedStyle(it).color)), light(ground(it))];
    const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (contrast < 4.5) low.push(`${it.tagName} "${it.textContent.slice(0, 30)}" ${contrast.toFixed(2)}`);
  }
  return low;
})()"""


def check_access(browser):
    """Every control has a name, and text stands out from its ground (WCAG 2.2, 1.4.3: 4.5 to 1)."""
    nameless = browser.run(
        """[...document.querySelectorAll("button, input, select, a, canvas[tabindex], [role=button]")]
          .filter((it) => !(it.getAttribute("aria-label") || it.textContent.trim() || it.closest("label")?.textContent.trim()))
          .map((it) => it.outerHTML.slice(0, 80))"""
    )
    require(not nameless, f"controls without a name: {nameless}")
    for scheme in ["light", "dark"]:
        browser.media(scheme=scheme)
        browser.settle()
        low = browser.run(CONTRAST)
        require(not low, f"too little contrast in the {scheme} page: {low[:5]}")
    browser.media(scheme="light")


def check_keyboard(browser):
    """Tab reaches the view, the chips and the links; the arrow keys and Enter choose a piece."""
    browser.run("document.querySelector('.skip').focus()")
    reached = set()
    for _ in range(60):
        browser.key("Tab", 9)
        reached.add(browser.run("document.activeElement.id || document.activeElement.closest('[id]')?.id"))
    wanted = {"canvas", "models", "color", "theme"} | ({"chips"} if browser.run("!document.getElementById('selection').hidden") else set())
    require(wanted <= reached, f"Tab does not reach {wanted - reached}")


def check(browser, folder):
    path = Path(folder) / "report.html"
    size = path.stat().st_size
    require(size < LARGEST, f"{path} has {size} bytes")
    browser.complaints.clear()
    browser.size(1440, 900)
    browser.media()
    browser.open(path)
    require(browser.run("document.getElementById('problem').hidden"), "the page reports a problem")
    check_meshes(browser)
    check_choice(browser)
    check_camera(browser)
    check_replay(browser)
    check_assembly(browser)
    check_access(browser)
    check_keyboard(browser)
    browser.size(390, 844, 2, True)
    browser.settle()
    wide = browser.run("document.documentElement.scrollWidth")
    require(wide <= 390, f"the page is {wide} pixels wide on a phone of 390")
    check_touch(browser)
    require(not browser.complaints, f"the console says {browser.complaints}")
    faces = browser.run("fabricate.meshes[0].faceCount")
    print(f"{path}: {size / 1e6:.2f} MB, {faces} faces, {browser.run('fabricate.seams.length')} seams: fine")


def pictures(browser, folder, into):
    name = Path(folder).name
    for label, width, height, scale, mobile, scheme in [
        ("light", 1440, 900, 1, False, "light"), ("dark", 1440, 900, 1, False, "dark"), ("phone", 390, 844, 2, True, "light")
    ]:
        browser.size(width, height, scale, mobile)
        browser.media(scheme=scheme)
        browser.open(Path(folder) / "report.html")
        browser.picture(Path(into) / f"{name}-{label}.png")
    browser.size(1440, 900)
    browser.print(Path(into) / f"{name}.pdf")


def main(arguments):
    into = None
    if "--pictures" in arguments:
        at = arguments.index("--pictures")
        into = arguments[at + 1]
        del arguments[at : at + 2]
        Path(into).mkdir(parents=True, exist_ok=True)
    with Browser() as browser:
        for folder in arguments:
            check(browser, folder)
            if into:
                pictures(browser, folder, into)


if __name__ == "__main__":
    main(sys.argv[1:])
