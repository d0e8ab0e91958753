#!/usr/bin/env python3
"""Every bad input ends with exit code 1 or 2, one line on standard error that names what is at fault and the
way out, and nothing written.

usage: bad_input_test.py PROGRAM MODEL_FOLDER IMAGE_DATA_FOLDER
"""
import copy
import json
import math
import os
import pathlib
import shutil
import struct
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "cli"))
from program import (HEIGHT, WIDTH, Program, Weights, expect, in_object, mask, photo, png, png_chunk,  # noqa: E402
                     require_files, run_checks, write_model)

CMYK_SIZE = (24, 16)


class Corpus:
    """Good and bad files in a folder, and the checks that use them."""

    def __init__(self, program, folder, data):
        self.program, self.folder, self.data = program, folder, data
        self.checks = []
        self.good = self.file("good.png", photo())
        self.other = self.file("other.png", photo(turn=0.7))
        self.good_mask = self.file("good_mask.png", mask())

    def file(self, name, content):
        path = self.folder / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    def pose(self, *options, reference=None, query=None, name="x"):
        out = self.folder / "out" / name
        if "--model" not in options:
            options = ("--model", self.program.model, *options)
        return out, self.program.run("pose", reference or self.good, query or self.other, "--threads", 1, "--json",
                                     out / "pose.json", "--visualize", out / "pose.png", *options)

    def fails(self, name, *options, mentions, code=1, **pictures):
        """A run that must fail with one line that has all of `mentions`."""
        def check():
            out, done = self.pose(*options, name=name.replace(" ", "_").replace("/", "_"), **pictures)
            lines = done.stderr.splitlines()
            expect(done.returncode == code, f"exit code {done.returncode} instead of {code}: {done.stderr}")
            expect(len(lines) == 1 and lines[0].startswith("antipode: "), f"not one line: {done.stderr!r}")
            for text in mentions:
                expect(str(text) in lines[0], f"does not mention {text}: {lines[0]}")
            expect(not done.stdout, f"printed a result: {done.stdout}")
            expect(not out.exists(), "wrote something")
        self.checks.append((name, check))

    def succeeds(self, name, *options, warning=None, **pictures):
        """A run that must succeed, with a warning that has `warning` if given."""
        def check():
            out, done = self.pose(*options, name=name.replace(" ", "_"), **pictures)
            expect(done.returncode == 0, f"exit code {done.returncode}: {done.stderr}")
            expect(not done.stderr, f"wrote to standard error: {done.stderr}")
            result = json.loads((out / "pose.json").read_text())
            expect((out / "pose.png").stat().st_size > 1000, "drew no picture")
            warnings = [text for text in result["warnings"] if "camera" not in text]
            if warning is None:
                expect(not warnings, f"unexpected warnings: {warnings}")
            else:
                expect(any(warning in text for text in warnings), f"no warning has {warning}: {warnings}")
        self.checks.append((name, check))


def add_pictures(corpus):
    whole = photo()
    corpus.fails("picture missing", reference="missing.png", mentions=["missing.png"])
    corpus.fails("second picture missing", query="missing.png", mentions=["missing.png"])
    corpus.fails("picture empty", reference=corpus.file("empty.png", b""), mentions=["empty.png", "empty"])
    for share in (10, 50, 95):
        cut = corpus.file(f"cut_{share}.png", whole[:len(whole) * share // 100])
        corpus.fails(f"picture truncated at {share} %", reference=cut, mentions=[cut.name])
    jpeg = (corpus.data / "cmyk.jpg").read_bytes()
    corpus.fails("jpeg truncated", reference=corpus.file("cut.jpg", jpeg[:len(jpeg) // 2]), mentions=["cut.jpg"])
    corpus.fails("text as picture", reference=corpus.file("text.jpg", b"hello\n" * 50), mentions=["text.jpg"])
    corpus.fails("folder as picture", reference=corpus.folder, mentions=[corpus.folder.name])
    corpus.fails("picture of 1 x 1", reference=corpus.file("one.png", png(1, 1, lambda x, y: (9, 9, 9))),
                 mentions=["one.png"])
    huge = b"\x89PNG\r\n\x1a\n" + png_chunk(b"IHDR", struct.pack(">IIBBBBB", 60000, 60000, 8, 2, 0, 0, 0)) + \
        png_chunk(b"IDAT", b"x") + png_chunk(b"IEND", b"")
    corpus.fails("picture of 60000 x 60000", reference=corpus.file("huge.png", huge), mentions=["huge.png", "60000"])
    for name in ("animated.gif", "animated.png", "animated.webp"):
        corpus.fails(name, reference=corpus.data / name, mentions=[name])
    corpus.succeeds("png named jpg", "--method", "prior", reference=corpus.file("renamed.jpg", whole))
    corpus.succeeds("16 bit png", "--method", "prior", reference=corpus.file("deep.png", photo(depth=16)))
    cmyk_mask = corpus.file("cmyk_mask.png", mask(lambda x, y: 4 < x < 20 and 4 < y < 12, *CMYK_SIZE))
    corpus.succeeds("cmyk jpeg", "--reference-mask", cmyk_mask, reference=corpus.data / "cmyk.jpg")


def add_masks(corpus):
    def with_mask(name, content):
        return ("--reference-mask", corpus.file(name, content))
    corpus.fails("mask missing", "--reference-mask", "no_mask.png", mentions=["no_mask.png"])
    corpus.fails("mask of another size", *with_mask("small_mask.png", mask(width=50, height=40)),
                 mentions=["small_mask.png", "50 x 40", f"{WIDTH} x {HEIGHT}"])
    corpus.fails("mask empty", *with_mask("no_object.png", mask(lambda x, y: False)),
                 mentions=["no_object.png", "over 125"])
    corpus.fails("mask full", *with_mask("all_object.png", mask(lambda x, y: True)),
                 mentions=["every pixel", "--reference-mask"])
    corpus.fails("no object in sight", reference=corpus.file("plain.png", png(40, 40, lambda x, y: (200, 200, 200))),
                 mentions=["plain.png", "--reference-mask"])
    corpus.succeeds("mask of two blobs", *with_mask("two.png", mask(lambda x, y: in_object(x, y) or (x < 9 and 4 < y < 20 and x > 2))),
                    warning="largest")
    corpus.succeeds("mask at the border", *with_mask("border.png", mask(lambda x, y: x < 40 and 20 < y < 50)),
                    warning="border")
    for box in ("1,2,3", "a,b,c,d", "1,2,3,4,5", "1.5,2,30,30"):
        corpus.fails(f"box {box}", "--reference-box", box, mentions=["--reference-box", "x,y,w"], code=2)
    corpus.fails("box outside", "--reference-box", "500,500,20,20", mentions=["--reference-box", "pixels"], code=2)
    corpus.fails("box negative", "--reference-box", "10,10,-5,20", mentions=["--reference-box", "pixels"], code=2)


def add_cameras(corpus):
    for camera in ("fov=0", "fov=-20", "fov=180", "fov=nan", "f=0", "f=-5", "f=inf", "f=abc", "100,100,48",
                   "nan,100,48,36", "100,-100,48,36", "0,0,0,0"):
        corpus.fails(f"camera {camera}", "--query-camera", camera, mentions=["--query-camera"], code=2)
    corpus.fails("camera file missing", "--query-camera", "no_camera.json", mentions=["no_camera.json"], code=2)
    good = {"fx": 100, "fy": 100, "cx": 48, "cy": 36, "width": WIDTH, "height": HEIGHT}
    changes = {"another_size": {"width": 640, "height": 480}, "zero": {"fx": 0}, "negative": {"fy": -1},
               "text": {"cx": "middle"}, "no_size": {"width": 0}}
    for name, change in changes.items():
        path = corpus.file(f"camera_{name}.json", json.dumps({**good, **change}))
        corpus.fails(f"camera file {name}", "--reference-camera", path, mentions=[path.name])
    corpus.fails("camera file nan", "--reference-camera", corpus.file("camera_nan.json", '{"fx": NaN}'),
                 mentions=["camera_nan.json"])
    corpus.fails("camera file distorted", "--reference-camera",
                 corpus.file("cameras.txt", "1 OPENCV 96 72 100 100 48 36 0.1 0 0 0\n"), mentions=["cameras.txt", "OPENCV"])
    corpus.succeeds("camera file", "--method", "prior", "--reference-camera", corpus.file("camera.json", json.dumps(good)))


def add_hard_pairs(corpus):
    """Pictures that a matcher makes nothing of: a stated failure, or a pose that is not sure of itself."""
    flat = corpus.file("flat.png", png(WIDTH, HEIGHT, lambda x, y: (90, 120, 150) if abs(x - 48) < 10 and abs(y - 36) < 30
                                       else (235, 236, 238)))
    tiny_object = lambda x, y: 4 < x < 12 and 4 < y < 12  # noqa: E731
    tiny = corpus.file("tiny.png", png(16, 16, lambda x, y: (20 * x, 15 * y, 90) if tiny_object(x, y) else (255, 255, 255)))
    stripes = corpus.file("stripes.png", png(WIDTH, HEIGHT, lambda x, y: ((255, 40, 40) if (x + y) % 8 < 4 else (20, 20, 200))
                                             if abs(x - 48) < 7 and abs(y - 36) < 30 else (235, 236, 238)))

    def unsure(name, query, *options, reference=None):
        """Fails and says so, or doubts its own result."""
        def check():
            out, done = corpus.pose(*options, reference=reference, query=query, name=name.replace(" ", "_"))
            if done.returncode == 1:
                expect(done.stderr.count("\n") == 1 and "--method auto" in done.stderr, done.stderr)
                return
            expect(done.returncode == 0, done.stderr)
            confidence = json.loads((out / "pose.json").read_text())["confidence"]
            expect(confidence < 0.5, f"confidence {confidence}")
        corpus.checks.append((name, check))

    for method in ("matching", "auto"):
        unsure(f"{method} without texture", flat, "--method", method)
        unsure(f"{method} of 16 pixels", tiny, "--method", method)
        unsure(f"{method} of another object", stripes, "--method", method)

    def identical():
        out, done = corpus.pose("--method", "auto", query=corpus.good, name="identical")
        expect(done.returncode == 0, done.stderr)
        pose = json.loads((out / "pose.json").read_text())
        expect(pose["rotation_angle_deg"] < 1, f"turned by {pose['rotation_angle_deg']} degrees")
    corpus.checks.append(("auto of identical pictures", identical))


def add_depths(corpus):
    method = ("--method", "sift+depth-pnp")
    corpus.fails("depth not given", *method, mentions=["--reference-depth"])
    corpus.fails("depth missing", *method, "--reference-depth", "no_depth.png", mentions=["no_depth.png"])
    corpus.fails("depth of 8 bits", *method, "--reference-depth", corpus.good_mask, mentions=["good_mask.png", "16-bit"])
    small = corpus.file("small_depth.png", png(20, 20, lambda x, y: (100,), 1, 16))
    corpus.fails("depth of another size", *method, "--reference-depth", small, mentions=["small_depth.png", "size"])
    depth = corpus.file("depth.png", png(WIDTH, HEIGHT, lambda x, y: (100,), 1, 16))
    corpus.fails("depth unit", *method, "--reference-depth", depth, "--reference-depth-unit", "0",
                 mentions=["--reference-depth-unit"], code=2)
    corpus.succeeds("depth that is not used", "--method", "prior", "--reference-depth", depth, warning="depth is not used")


def add_weights(corpus):
    """Damaged weights; model.json fits the damaged file unless the damage is a wrong sha256 or size."""
    source = corpus.program.model
    whole = (source / "model.safetensors").read_bytes()
    weights = Weights(source / "model.safetensors")
    first, second = weights.names()[:2]

    def model(name, content, mentions, **changes):
        folder = write_model(corpus.folder / "models" / name, source, content, **changes)
        corpus.fails(f"weights {name}", "--model", folder, mentions=[name, *mentions])

    def header(name, edit, mentions):
        damaged = copy.deepcopy(weights)
        edit(damaged.header)
        model(name, damaged.bytes(), mentions, tensors=len(damaged.names()))

    model("truncated", whole[:len(whole) // 2], ["model.safetensors"])
    model("cut_in_header", whole[:100], ["model.safetensors"])
    model("empty", b"", ["model.safetensors"])
    model("header_zero", struct.pack("<Q", 0) + whole[8:], ["model.safetensors", "header"])
    model("header_huge", struct.pack("<Q", 2**63) + whole[8:], ["model.safetensors", "header"])
    model("header_past_end", struct.pack("<Q", len(whole)) + whole[8:], ["model.safetensors", "header"])
    model("header_no_json", whole[:8] + b"x" + whole[9:], ["model.safetensors"])
    header("overlapping", lambda h: h[second].update(data_offsets=h[first]["data_offsets"], shape=h[first]["shape"],
                                                     dtype=h[first]["dtype"]), ["model.safetensors"])
    header("out_of_range", lambda h: h[weights.largest()].update(
        data_offsets=[h[weights.largest()]["data_offsets"][0], 2**40]), [weights.largest()])
    header("wrong_dtype", lambda h: h[first].update(dtype="Q7"), [first, "Q7"])
    header("wrong_shape", lambda h: h[first].update(shape=[2**40, 2**40]), [first])

    def without_last(h):
        last = max((name for name in h if name != "__metadata__"), key=lambda name: h[name]["data_offsets"][1])
        h["surplus_tensor"] = h.pop(last)
    header("other_names", without_last, ["missing", "surplus_tensor"])

    not_finite = copy.deepcopy(weights)
    begin = not_finite.header[weights.largest()]["data_offsets"][0]
    not_finite.data[begin:begin + 4] = b"\xff\xff\xff\xff"
    model("nan_values", not_finite.bytes(), [weights.largest()])

    flipped = bytearray(whole)
    flipped[-1] ^= 1
    model("wrong_sha256", bytes(flipped), ["sha256"], sha256=json.loads((source / "model.json").read_text())["sha256"])
    model("wrong_tensor_count", whole, ["tensors"], tensors=3)

    broken = write_model(corpus.folder / "models" / "broken_json", source, whole)
    (broken / "model.json").write_text("{")
    corpus.fails("weights with a broken model.json", "--model", broken, mentions=["model.json"])
    corpus.fails("model unknown", "--model", "priro", mentions=["priro", "known"])

    def by_environment():
        folder = write_model(corpus.folder / "environment" / "prior", source, whole[:-1])
        environment = {**os.environ, "ANTIPODE_MODELS": str(folder.parent)}
        done = corpus.program.run("pose", corpus.good, corpus.other, environment=environment)
        # The file is whole for its model.json, but its last tensor is cut.
        expect(done.returncode == 1 and "environment" in done.stderr, done.stderr)
        expect(len(done.stderr.splitlines()) == 1, done.stderr)
    corpus.checks.append(("weights by ANTIPODE_MODELS", by_environment))


# A sphere of a few rings: it looks alike from every side.
def sphere_mesh(rings=12):
    columns = 2 * rings
    lines = []
    for i in range(rings + 1):
        for j in range(columns):
            polar, azimuth = math.pi * i / rings, 2 * math.pi * j / columns
            lines.append(f"v {math.sin(polar) * math.cos(azimuth)} {math.cos(polar)} {math.sin(polar) * math.sin(azimuth)}")
    for i in range(rings):
        for j in range(columns):
            a, b = i * columns + j + 1, i * columns + (j + 1) % columns + 1
            lines += [f"f {a} {b} {b + columns}", f"f {a} {b + columns} {a + columns}"]
    return "\n".join(lines) + "\n"


def add_references(corpus):
    mesh = corpus.file("sphere.obj", sphere_mesh())
    whole = corpus.folder / "reference"
    build = ("reference", "build", "--model", corpus.program.model, "--threads", 1)

    def run(*arguments):
        return corpus.program.run(*build, *arguments)

    def refused(name, code, mentions, *arguments):
        def check():
            done = run(*arguments)
            expect(done.returncode == code and done.stderr.count("\n") == 1, f"{done.returncode}: {done.stderr}")
            for text in mentions:
                expect(text in done.stderr, f"does not mention {text}: {done.stderr}")
        corpus.checks.append((name, check))

    refused("reference of nothing", 2, ["IMAGE", "--mesh"], "--out", corpus.folder / "r1")
    refused("reference of no mesh", 1, ["good.png"], "--mesh", corpus.good, "--out", corpus.folder / "r2")
    refused("reference of a missing mesh", 1, ["no.glb"], "--mesh", "no.glb", "--out", corpus.folder / "r3")
    refused("reference with four views", 2, ["--views"], "--mesh", mesh, "--views", "4", "--out", corpus.folder / "r4")
    refused("reference from elevation 95", 2, ["--elevation"], corpus.good, "--elevation", "95", "--out", corpus.folder / "r5")
    refused("reference without a diffusion model", 1, ["zero123", "models import"], corpus.good, "--synthesis-model", "zero123",
            "--out", corpus.folder / "r6")

    def built():
        if not (whole / "reference.json").is_file():
            done = run("--mesh", mesh, "--views", "16", "--out", whole)
            expect(done.returncode == 0, done.stderr)
        return whole

    def sphere():
        done = corpus.program.run("pose", built(), corpus.good, "--model", corpus.program.model, "--json", "-")
        expect(done.returncode == 0, done.stderr)
        result = json.loads(done.stdout)
        expect(result["confidence"] < 0.5, result["confidence"])
        expect(any("alike from many sides" in warning for warning in result["warnings"]), result["warnings"])
    corpus.checks.append(("reference of a sphere", sphere))

    def damaged(name, damage, mentions):
        def check():
            folder = corpus.folder / ("damaged_" + name.replace(" ", "_"))
            shutil.copytree(built(), folder)
            damage(folder)
            done = corpus.program.run("pose", folder, corpus.good, "--model", corpus.program.model)
            expect(done.returncode == 1 and done.stderr.count("\n") == 1, f"{done.returncode}: {done.stderr}")
            for text in (*mentions, "reference build"):
                expect(text in done.stderr, f"does not mention {text}: {done.stderr}")
        corpus.checks.append(("reference " + name, check))

    def change(file, **fields):
        def damage(folder):
            path = folder / file
            content = json.loads(path.read_text())
            path.write_text(json.dumps({**content, **fields}))
        return damage

    damaged("features cut", lambda folder: (folder / "features.safetensors").write_bytes(b"x"), ["features.safetensors"])
    damaged("views changed", change("views.json", views=[]), ["views.json"])
    damaged("of another version", change("reference.json", format=7), ["another version"])
    damaged("of other weights", change("reference.json", prior_sha256="0"), ["other weights"])
    damaged("no json", lambda folder: (folder / "reference.json").write_text("{"), ["reference.json", "damaged"])


def add_usage(corpus):
    corpus.fails("no hypotheses", "--hypotheses", "0", mentions=["hypotheses", "1 to 50"], code=2)
    corpus.fails("hypotheses no number", "--hypotheses", "many", mentions=["--hypotheses"], code=2)
    corpus.fails("unknown option", "--refrence-mask", "x", mentions=["--refrence-mask", "--reference-mask"], code=2)
    corpus.fails("unknown method", "--method", "magic", mentions=["--method", "prior"], code=2)
    corpus.fails("unknown device", "--device", "abacus", mentions=["device", "cpu"], code=2)
    corpus.fails("negative threads", "--threads", "-3", mentions=["--threads"], code=2)
    corpus.fails("object without size", "--object-size", "0", mentions=["--object-size"], code=2)
    corpus.fails("surplus picture", "third.png", mentions=["third.png", "--help"], code=2)
    corpus.fails("configuration unknown option", "--config", corpus.file("bad.toml", "hypothesis = 3\n"),
                 mentions=["bad.toml", "hypothesis", "hypotheses"])
    corpus.fails("configuration missing", "--config", "no.toml", mentions=["no.toml"])

    def bad_command():
        done = corpus.program.run("poes", corpus.good, corpus.other)
        expect(done.returncode == 2, done.returncode)
        expect(done.stderr.count("\n") == 1 and "'pose'" in done.stderr, done.stderr)
    corpus.checks.append(("unknown command", bad_command))

    def picture_of_unknown_kind():
        out = corpus.folder / "kinds"
        done = corpus.program.run("pose", corpus.good, corpus.other, "--model", corpus.program.model, "--visualize",
                                  out / "pose.xyz", "--json", out / "pose.json")
        expect(done.returncode in (1, 2) and "pose.xyz" in done.stderr, done.stderr)
        expect(done.stderr.count("\n") == 1, done.stderr)
        expect(not (out / "pose.json").exists(), "wrote a result")
    corpus.checks.append(("picture of unknown kind", picture_of_unknown_kind))


def main(arguments):
    if len(arguments) != 3:
        sys.exit(__doc__)
    program = Program(arguments[0], arguments[1])
    require_files(program)
    with tempfile.TemporaryDirectory(prefix="antipode-bad-input-") as folder:
        corpus = Corpus(program, pathlib.Path(folder), pathlib.Path(arguments[2]))
        for add in (add_pictures, add_masks, add_cameras, add_hard_pairs, add_depths, add_weights, add_references, add_usage):
            add(corpus)
        return run_checks(corpus.checks)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
