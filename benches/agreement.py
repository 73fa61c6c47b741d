#!/usr/bin/env python3
"""Compares the path tracer's image means with converged references.

    benches/agreement.py [SCENE ...] [--shared DIR] [--binary target/release/dualux]
                         [--error 0.005] [--seconds 600] [--keep DIR]

For each scene of DIR/ref and DIR/scenes (default ../shared) the passes are doubled until the standard
error of the image mean is below --error in every channel, or the time is used up; then the mean over the
reference's valid pixels is compared per channel. Needs numpy and OpenEXR from PyPI.

Exit code 1 if a scene is off by more than its tolerance (1 % for ref, 2 % for public scenes made by other
programs, 3 % for veach-ajar, where other path tracers differ by 2 % as well) and by more than 3 standard errors.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import numpy as np
import OpenEXR

# name: (scene, reference or None for the two halves of ref/, scale, tolerance)
PUBLIC = {
    "cornell-box": ("cornell-box/scene.xml", "cornell-box/TungstenRender.exr", 0.25, 0.02),
    "veach-mis": ("veach-mis/scene.xml", "veach-mis/TungstenRender.exr", 0.25, 0.02),
    "veach-bidir": ("veach-bidir/scene.xml", "veach-bidir/TungstenRender.exr", 0.25, 0.02),
    "veach-ajar": ("veach-ajar/scene.xml", "veach-ajar/TungstenRender.exr", 0.25, 0.03),
    "staircase2": ("staircase2/scene.xml", "staircase2/TungstenRender.exr", 0.25, 0.02),
    "living-room": ("living-room/scene.xml", "living-room/TungstenRender.exr", 0.25, 0.02),
    "living-room-0.6": ("living-room/scene_v0.6_asfound.xml", "living-room/TungstenRender.exr", 0.25, 0.02),
    "water-caustic": ("water-caustic/scene_v0.6.xml", "water-caustic/TungstenRender.exr", 0.25, None),
}
# Means of cbox-legacy by Mitsuba 3.9.1 at 128 x 128 with 256 samples (no picture is at hand), standard error 0.15 %.
LEGACY = ("cbox-legacy/scene.xml", (0.22592, 0.11593, 0.02647), 0.25, 0.01)
REF = ["cornell-box", "cornell-spheres", "caustic-ring", "penumbra", "room-window", "inner-room", "many-lights",
       "hairball-lite"]


def read(path):
    """(rgb, mask) of the first part with R, G, B; the mask is True where a pixel counts."""
    for part in OpenEXR.File(path).parts:
        ch = part.channels
        for key in ("RGB", "RGBA"):
            if key in ch:
                rgb = np.asarray(ch[key].pixels, float)[..., :3]
                break
        else:
            if not all(k in ch for k in "RGB"):
                continue
            rgb = np.stack([np.asarray(ch[k].pixels, float) for k in "RGB"], -1)
        mask = np.asarray(ch["mask"].pixels) > 0.5 if "mask" in ch else np.ones(rgb.shape[:2], bool)
        return rgb, mask & np.isfinite(rgb).all(-1)
    raise SystemExit(path + ": no R, G, B channels")


def variance(path):
    ch = OpenEXR.File(path).parts[0].channels
    if "variance" in ch:  # the reader groups channels of one layer
        return np.asarray(ch["variance"].pixels, float)
    return np.stack([np.asarray(ch["variance." + k].pixels, float) for k in "RGB"], -1)


def shrink(mask, shape):
    """The mask at another size: a pixel counts if all that it covers counts."""
    ys = (np.arange(shape[0] + 1) * mask.shape[0] / shape[0]).astype(int)
    xs = (np.arange(shape[1] + 1) * mask.shape[1] / shape[1]).astype(int)
    return np.array([[mask[ys[j]:ys[j + 1], xs[i]:xs[i + 1]].all() for i in range(shape[1])] for j in range(shape[0])])


def render(o, scene, scale, passes, limit, out):
    cmd = [o.binary, "render", scene, "-o", out, "--integrator", "path", "--scale", str(scale), "--passes", str(passes),
           "--time-limit", "%gs" % limit, "--aov", "variance", "-q", "--seed", "1"]
    done = subprocess.run(cmd, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr.strip())
    return done.stderr.strip()


def check(o, name, scene, reference, scale, tolerance, folder):
    start, passes = time.time(), 16
    out = os.path.join(folder, name.replace("/", "-") + ".exr")
    while True:
        left = o.seconds - (time.time() - start)
        said = render(o, scene, scale, passes, max(left, 5), out)
        image, _ = read(out)
        var = variance(out)
        if isinstance(reference, tuple):
            truth, keep = np.array(reference), np.ones(image.shape[:2], bool)
        else:
            halves = [read(r) for r in reference]
            ref = np.mean([h[0] for h in halves], 0)
            mask = halves[0][1]
            truth, keep = ref[mask].mean(0), mask
            if mask.shape != image.shape[:2]:
                keep = mask if mask.all() else None
                if keep is None:
                    keep = shrink(mask, image.shape[:2])
                    truth = ref[np.kron(keep, np.ones((mask.shape[0] // keep.shape[0], mask.shape[1] // keep.shape[1]), bool))].mean(0) \
                        if all(m % k == 0 for m, k in zip(mask.shape, keep.shape)) else truth
                else:
                    keep = np.ones(image.shape[:2], bool)
        mean = image[keep].mean(0)
        error = np.sqrt(var[keep].sum(0)) / keep.sum()
        relative = error / np.maximum(mean, 1e-9)
        left = o.seconds - (time.time() - start)
        if relative.max() < o.error or left < 5:
            break
        passes = int(passes * min(8, max(2, (relative.max() / o.error) ** 2)))
    off = mean / truth - 1
    good = tolerance is None or all(abs(d) <= tolerance or abs(m - t) <= 3 * e for d, m, t, e in zip(off, mean, truth, error))
    print("%-16s %6.1f s  %7d spp  off %s %%  +- %s %%  %s" % (
        name, time.time() - start, passes, " ".join("%+6.2f" % (100 * d) for d in off),
        " ".join("%.2f" % (100 * r) for r in relative), "ok" if good else "OFF"), flush=True)
    for line in said.splitlines():
        if line.startswith("note:"):
            print("    " + line)
    return good


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("scene", nargs="*")
    ap.add_argument("--shared", default=os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "shared"))
    ap.add_argument("--binary", default="target/release/dualux")
    ap.add_argument("--error", type=float, default=0.005)
    ap.add_argument("--seconds", type=float, default=600)
    ap.add_argument("--keep", help="folder for the images")
    o = ap.parse_args()
    folder = o.keep or tempfile.mkdtemp()
    os.makedirs(folder, exist_ok=True)
    jobs = []
    for name in REF:
        base = os.path.join(o.shared, "ref", name)
        jobs.append(("ref/" + name, base + ".xml", [base + ".a.exr", base + ".b.exr"], 1, 0.01))
    for name, (scene, reference, scale, tolerance) in PUBLIC.items():
        at = os.path.join(o.shared, "scenes")
        jobs.append((name, os.path.join(at, scene), [os.path.join(at, reference)], scale, tolerance))
    scene, truth, scale, tolerance = LEGACY
    jobs.append(("cbox-legacy", os.path.join(o.shared, "scenes", scene), truth, scale, tolerance))
    chosen = [j for j in jobs if not o.scene or j[0] in o.scene]
    bad = 0
    for name, scene, reference, scale, tolerance in chosen:
        try:
            good = check(o, name, scene, reference, scale, tolerance, os.path.join(folder, ""))
        except RuntimeError as e:
            print("%-16s FAILED: %s" % (name, e))
            good = False
        bad += not good
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
