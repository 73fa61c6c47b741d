"""Compares the speed of ray queries with Embree on the same mesh and rays, and checks that the hits agree.

    python3 benches/embree_compare.py [--triangles 250000 1000000] [--rays 1000000] [--rounds 5] [--portable]

Needs numpy and embreex (PyPI; bundles Embree 4) and a release build of the example:

    cargo build --release --example trace_rays

Scene: a closed room with a rough floor and bumpy spheres. Rays: primary ones in image order (8 x 8 tiles), cosine-distributed
bounces from their hits, and shadow rays from the hits to points of a ceiling lamp.
embreex answers a batch by a loop of rtcIntersect1 (rtcOccluded1 for 'OCCLUDED') over single rays in the calling thread, without packets
by default without robust mode (`--robust` has it; ours is always watertight); its time includes filling the ray records.
Both programs run in turns, `rounds` times, timed by the CPU time of their thread, and the best time of each counts. `overhead` is the time embreex takes per
batch when every ray misses the scene at once; the second ratio takes it off Embree's time.
"""

import argparse
import json
import os
import subprocess
import tempfile
import time

import numpy as np
from embreex import rtcore, rtcore_scene
from embreex.mesh_construction import TriangleMesh

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
EXAMPLE = os.path.join(os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target")), "release/examples/trace_rays")


def grid(points):
    """Triangles over an (n, m, 3) array of points."""
    n, m = points.shape[:2]
    i, j = np.meshgrid(np.arange(n - 1), np.arange(m - 1), indexing="ij")
    a = (i * m + j).ravel()
    quads = np.stack([a, a + m, a + m + 1, a + 1], axis=1)
    return points.reshape(-1, 3), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def scene(count, rng):
    """Room [-1,1]^3 with a rough floor and 40 bumpy spheres, about `count` triangles."""
    parts = []
    n = int(np.sqrt(count * 0.3 / 2)) + 1
    x, z = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n), indexing="ij")
    y = -0.9 + 0.05 * np.sin(9 * x) * np.cos(7 * z) + 0.01 * np.sin(61 * x + 3) * np.sin(53 * z)
    parts.append(grid(np.stack([x, y, z], axis=-1)))
    rings = int(np.sqrt(count * 0.7 / 40 / 4)) + 1
    theta, phi = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings + 1), indexing="ij")
    unit = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1)
    for _ in range(40):
        center = rng.uniform([-0.8, -0.7, -0.8], [0.8, 0.6, 0.8])
        bumps = 1 + 0.05 * np.sin(20 * unit[..., :1]) * np.sin(17 * unit[..., 1:2]) * np.cos(23 * unit[..., 2:])
        parts.append(grid(center + rng.uniform(0.05, 0.15) * bumps * unit))
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    sides = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
    parts.append((corners, np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])))
    offsets = np.cumsum([0] + [len(v) for v, _ in parts[:-1]])
    vertices = np.concatenate([v for v, _ in parts]).astype("<f4")
    return vertices, np.concatenate([t + o for (_, t), o in zip(parts, offsets)]).astype("<i4")


def write_ply(path, vertices, triangles):
    faces = np.empty(len(triangles), dtype=[("n", "u1"), ("i", "<i4", 3)])
    faces["n"], faces["i"] = 3, triangles
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    with open(path, "wb") as file:
        file.write(header.encode() + vertices.tobytes() + faces.tobytes())


def primary(count):
    """Camera rays in image order of 8 x 8 tiles."""
    side = int(np.sqrt(count)) // 8 * 8
    t = np.arange(side // 8)
    ty, tx, y, x = np.meshgrid(t, t, np.arange(8), np.arange(8), indexing="ij")
    u = ((8 * tx + x).ravel() + 0.5) / side * 2 - 1
    v = ((8 * ty + y).ravel() + 0.5) / side * 2 - 1
    d = np.stack([u, -v, np.full_like(u, -1.0)], axis=1)
    return np.tile(np.array([0.0, 0.1, 0.95]), (len(d), 1)), d / np.linalg.norm(d, axis=1, keepdims=True)


def bounce(o, d, result, rng):
    """Points and normals where rays hit, and cosine-distributed directions from there."""
    hit = result["primID"] >= 0
    o, d, t, n = o[hit], d[hit], result["tfar"][hit].astype(float), result["Ng"][hit].astype(float)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    n *= -np.sign(np.sum(n * d, axis=1, keepdims=True))
    p = o + d * t[:, None] + 1e-4 * n
    w = rng.normal(size=p.shape)
    w = n + w / np.linalg.norm(w, axis=1, keepdims=True)
    return p, w / np.linalg.norm(w, axis=1, keepdims=True)


class Embree:
    def __init__(self, vertices, triangles, robust):
        self.device = rtcore.EmbreeDevice()
        self.scene = rtcore_scene.EmbreeScene(self.device, robust=robust)
        self.mesh = TriangleMesh(self.scene, vertices, triangles)

    def run(self, rays, **more):
        o, d, far = (np.ascontiguousarray(a) for a in (rays[:, :3], rays[:, 3:6], rays[:, 7]))
        start = time.thread_time()
        result = self.scene.run(o, d, far, **more)
        return time.thread_time() - start, result


def ours(ply, rays, folder, portable):
    ray_file, hit_file = os.path.join(folder, "rays.f32"), os.path.join(folder, "hits.bin")
    rays.astype("<f4").tofile(ray_file)
    command = [EXAMPLE] + ["--portable"] * portable + [ply, ray_file, hit_file]
    out = subprocess.run(command, check=True, capture_output=True, text=True)
    return json.loads(out.stdout), np.fromfile(hit_file, dtype=[("t", "<f4"), ("prim", "<u4")])


def records(o, d, far):
    out = np.empty((len(o), 8), np.float32)
    out[:, :3], out[:, 3:6], out[:, 6], out[:, 7] = o, d, 0.0, far
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--triangles", type=int, nargs="+", default=[250_000, 1_000_000])
    parser.add_argument("--rays", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--portable", action="store_true", help="time the portable path")
    parser.add_argument("--robust", action="store_true", help="Embree in its robust mode")
    args = parser.parse_args()
    for count in args.triangles:
        rng = np.random.default_rng(1)
        vertices, triangles = scene(count, rng)
        start = time.process_time()
        embree = Embree(vertices, triangles, args.robust)
        o, d = primary(args.rays)
        _, first = embree.run(records(o, d, 1e30), output=1)
        print(f"{len(triangles)} triangles; Embree build and first batch {time.process_time() - start:.2f} s CPU")
        p, w = bounce(o, d, first, rng)
        lamp = rng.uniform([-0.3, 0.97, -0.3], [0.3, 0.97, 0.3], size=p.shape)
        shuffled = rng.permutation(len(p))
        kinds = {
            "primary": (records(o, d, 1e30), False),
            "diffuse": (records(p, w, 1e30), False),
            "shuffled": (records(p[shuffled], w[shuffled], 1e30), False),
            "shadow": (records(p, lamp - p, 0.999), True),
        }
        with tempfile.TemporaryDirectory() as folder:
            ply = os.path.join(folder, "mesh.ply")
            write_ply(ply, vertices, triangles)
            for kind, (rays, any_hit) in kinds.items():
                compare(kind, rays, any_hit, embree, ply, folder, args)


def compare(kind, rays, any_hit, embree, ply, folder, args):
    missing = rays.copy()
    missing[:, :3] += 100
    missing[:, 3:6] = [1, 0, 0]
    query = {"query": "OCCLUDED" if any_hit else "INTERSECT"}
    theirs, overhead, mine, build = [], [], [], []
    for _ in range(args.rounds):
        seconds, _ = embree.run(rays, **query)
        theirs.append(len(rays) / seconds * 1e-6)
        overhead.append(embree.run(missing, **query)[0])
        report, hits = ours(ply, rays, folder, args.portable)
        mine.append(report["any_mrays" if any_hit else "closest_mrays"])
        build.append(report["build_s"])
    _, truth = embree.run(rays, output=1)
    if any_hit:
        # Batches with output ignore the ends of the rays: compare what the occlusion query says.
        _, blocked = embree.run(rays, **query)
        truth["primID"] = np.where(blocked >= 0, hits["prim"].astype(np.int32), -1)
        truth["primID"][(blocked >= 0) & ~np.isfinite(hits["t"])] = 0
        truth["tfar"] = hits["t"]
    same_prim = hits["prim"].astype(np.int64) == (truth["primID"].astype(np.int64) & 0xFFFFFFFF)
    both = np.isfinite(hits["t"]) & (truth["primID"] >= 0)
    agree = same_prim.copy()
    agree[both] |= np.abs(hits["t"][both] - truth["tfar"][both]) <= 1e-4 * truth["tfar"][both]
    pairs = np.array(mine) / np.array(theirs)
    net = max(mine) * (len(rays) / max(theirs) - min(overhead) * 1e6) / len(rays)
    print(
        f"  {kind:9s} ours {max(mine):6.2f} Mray/s, Embree {max(theirs):6.2f}: ratio {max(mine) / max(theirs):.2f} "
        f"(median of pairs {np.median(pairs):.2f}, overhead taken off {net:.2f}); "
        f"same triangle {same_prim.mean():.6f}, same hit {agree.mean():.6f}; build {min(build):.2f} s"
    )
    assert agree.mean() > 0.9999, "hits disagree"


if __name__ == "__main__":
    main()
