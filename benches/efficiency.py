#!/usr/bin/env python3
"""Efficiency of the path tracer beside Mitsuba 3 on the same scene, in one run.

    benches/efficiency.py [SCENE ...] [--ref DIR] [--spp 16] [--rounds 3] [--variants scalar_rgb,llvm_ad_rgb]

efficiency = 1 / (relMSE x CPU seconds), relMSE untrimmed against the two halves of the reference, start-up left out on
both sides (ours: a run with one sample per pixel is taken off; Mitsuba: render only, kernels compiled before). Runs
alternate, medians are printed. Needs numpy, OpenEXR and mitsuba from PyPI.
"""
import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
import numpy as np
import OpenEXR


def read(path):
    ch = OpenEXR.File(path).parts[0].channels
    key = "RGB" if "RGB" in ch else "RGBA"
    return np.asarray(ch[key].pixels, float)[..., :3]


def relmse(image, a, b):
    r = (a + b) / 2
    return float(((image - a) * (image - b) / (r * r + 0.01)).mean())


def ours(o, scene, spp, seed, out):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([o.binary, "render", scene, "-o", out, "--integrator", "path", "--spp", str(spp), "--seed", str(seed), "-q"],
                   check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def theirs(variant, scene, spp, seed, warm):
    """Child process: (CPU seconds, image) of Mitsuba."""
    import mitsuba as mi
    mi.set_variant(variant)
    loaded = mi.load_file(scene)
    if warm:
        np.array(mi.render(loaded, spp=spp, seed=seed + 1000))
    start = time.process_time()
    image = np.array(mi.render(loaded, spp=spp, seed=seed))
    return time.process_time() - start, image


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("scene", nargs="*", default=["cornell-box", "penumbra"])
    ap.add_argument("--ref", default=os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "shared", "ref"))
    ap.add_argument("--binary", default="target/release/dualux")
    ap.add_argument("--spp", type=int, default=16)
    ap.add_argument("--rounds", type=int, default=3)
    ap.add_argument("--variants", default="scalar_rgb,llvm_ad_rgb")
    ap.add_argument("--child", nargs=4, help=argparse.SUPPRESS)
    o = ap.parse_args()
    if o.child:
        variant, scene, spp, seed = o.child
        seconds, image = theirs(variant, scene, int(spp), int(seed), variant != "scalar_rgb")
        np.save(sys.stdout.buffer, np.append(image[..., :3].ravel(), seconds))
        return
    folder = tempfile.mkdtemp()
    for name in o.scene:
        scene = os.path.join(o.ref, name + ".xml")
        a, b = (read(os.path.join(o.ref, "%s.%s.exr" % (name, half))) for half in "ab")
        rows = {}
        for seed in range(o.rounds):
            out = os.path.join(folder, "x.exr")
            idle = ours(o, scene, 1, seed, out)
            seconds = ours(o, scene, o.spp + 1, seed, out) - idle
            # One sample more was rendered than the time counts; its share of the error is put back.
            error = relmse(read(out), a, b) * (o.spp + 1) / o.spp
            rows.setdefault("dualux", []).append((seconds, error))
            for variant in o.variants.split(","):
                child = subprocess.run([sys.executable, __file__, "--child", variant, scene, str(o.spp), str(seed)],
                                       stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
                if child.returncode:
                    print("  %s does not run on this machine: left out" % variant)
                    o.variants = ",".join(v for v in o.variants.split(",") if v != variant)
                    continue
                data = child.stdout
                path = os.path.join(folder, "x.npy")
                with open(path, "wb") as fh:
                    fh.write(data)
                flat = np.load(path)
                rows.setdefault(variant, []).append((float(flat[-1]), relmse(flat[:-1].reshape(a.shape), a, b)))
        paths = a.shape[0] * a.shape[1] * o.spp
        base = np.median([1 / (t * e) for t, e in rows["scalar_rgb"]]) if "scalar_rgb" in rows else None
        print(name, "%d spp" % o.spp)
        for who, points in rows.items():
            efficiency = np.median([1 / (t * e) for t, e in points])
            print("  %-12s %6.2f CPU s  %5.2f M paths/s  relMSE %.2e  efficiency %8.1f%s" % (
                who, np.median([t for t, _ in points]), paths / np.median([t for t, _ in points]) * 1e-6,
                np.median([e for _, e in points]), efficiency,
                "" if base is None else "  x%.2f of scalar_rgb" % (efficiency / base)), flush=True)


if __name__ == "__main__":
    main()
