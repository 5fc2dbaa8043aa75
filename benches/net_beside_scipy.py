"""Time of one iteration of guided projection in SciPy, with the variables of the paper (Wang, Pellis, Rist, Pottmann, Müller 2019,
section 5): points, unit edge vectors and edge lengths, at the sizes of benches/net.rs. Needs numpy and scipy: python benches/net_beside_scipy.py

Constraints are those of figure 1 (net, geodesic parallel coordinates, isometry) and a handle; one iteration assembles the linear
rows H X = r and solves (H'H + eps^2) X = H'r + eps^2 X0, once by the sparse LU of SciPy.
"""

import time

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

EPS = 1e-3


def bottle(m, n, sweep=4.0):
    t = np.linspace(0, 1, m)[:, None]
    a = sweep * (np.linspace(0, 1, n)[None, :] - 0.5)
    r = 4 + 1.2 * np.sin(6 * t) - 1.5 * t * t
    return np.stack([r * np.cos(a), r * np.sin(a), 20 * t + 0 * a], -1).reshape(-1, 3)


class Net:
    def __init__(self, m, n):
        self.points = bottle(m, n)
        k = np.arange(m * n).reshape(m, n)
        along = np.stack([k[:-1].ravel(), k[1:].ravel()], 1)
        across = np.stack([k[:, :-1].ravel(), k[:, 1:].ravel()], 1)
        both = np.concatenate([along, across])
        self.half = np.concatenate([both, both[:, ::-1]])  # directed edges
        number = {tuple(e): i for i, e in enumerate(self.half)}
        scale = np.linalg.norm(self.points[both[:, 0]] - self.points[both[:, 1]], axis=1).mean()
        self.points /= scale
        self.kept = np.linalg.norm(self.points[self.half[:, 1]] - self.points[self.half[:, 0]], axis=1)
        stars = []
        for i in range(1, m - 1):
            for j in range(1, n - 1):
                c = k[i, j]
                u, v, w, z = (number[c, k[i + 1, j]], number[c, k[i, j + 1]], number[c, k[i - 1, j]], number[c, k[i, j - 1]])
                stars += [(u, v, z), (w, v, z)]
        self.stars = np.array(stars)
        self.handle = m * n - n // 2 - 1
        self.target = self.points[self.handle] + np.array([-0.42, 0, -0.17]) / scale  # one step of the way in benches/net.rs
        self.held = [n // 2, n // 2 + 1, n + n // 2]
        e = self.points[self.half[:, 1]] - self.points[self.half[:, 0]]
        self.x = np.concatenate([self.points.ravel(), (e / self.kept[:, None]).ravel(), self.kept])

    def iterate(self):
        p, h = len(self.points), len(self.half)
        x = self.x
        unit, length = x[3 * p : 3 * p + 3 * h].reshape(-1, 3), x[3 * p + 3 * h :]
        rows, cols, vals, rhs = [], [], [], []
        count = 0

        def add(r, c, v):
            rows.append(np.asarray(r).ravel()), cols.append(np.asarray(c).ravel())
            vals.append(np.broadcast_to(v, np.shape(r)).ravel())

        ids = np.arange(h)
        for d in range(3):  # f_j - f_i = w e, linearised
            r = count + ids
            add(r, 3 * self.half[:, 1] + d, 1.0), add(r, 3 * self.half[:, 0] + d, -1.0)
            add(r, 3 * p + 3 * ids + d, -length), add(r, 3 * p + 3 * h + ids, -unit[:, d])
            rhs.append(-length * unit[:, d])
            count += h
        r = count + ids  # |e| = 1
        for d in range(3):
            add(r, 3 * p + 3 * ids + d, 2 * unit[:, d])
        rhs.append(1 + (unit**2).sum(1))
        count += h
        add(count + ids, 3 * p + 3 * h + ids, 1.0)  # isometry
        rhs.append(self.kept)
        count += h
        s = self.stars  # <e_u, e_v> = <e_u, e_z>
        r = count + np.arange(len(s))
        difference = unit[s[:, 1]] - unit[s[:, 2]]
        for d in range(3):
            add(r, 3 * p + 3 * s[:, 0] + d, difference[:, d])
            add(r, 3 * p + 3 * s[:, 1] + d, unit[s[:, 0], d]), add(r, 3 * p + 3 * s[:, 2] + d, -unit[s[:, 0], d])
        rhs.append((unit[s[:, 0]] * difference).sum(1))
        count += len(s)
        for point, target in [(self.handle, self.target)] + [(k, self.points[k]) for k in self.held]:
            add(count + np.arange(3), 3 * point + np.arange(3), 1.0)
            rhs.append(target)
            count += 3
        matrix = sp.csr_matrix((np.concatenate(vals), (np.concatenate(rows), np.concatenate(cols))), (count, len(x)))
        right = np.concatenate(rhs)
        normal = (matrix.T @ matrix + EPS**2 * sp.identity(len(x))).tocsc()
        self.x = spsolve(normal, matrix.T @ right + EPS**2 * x)
        return np.linalg.norm(matrix @ x - right)


if __name__ == "__main__":
    print(f"{'points':>8}{'variables':>11}{'s/iteration':>13}{'R at last':>11}")
    for m, n in [(21, 21), (37, 31), (54, 27), (117, 41)]:
        net = Net(m, n)
        repeats = 6 if m < 100 else 3
        start = time.perf_counter()
        for _ in range(repeats):
            last = net.iterate()
        print(f"{m * n:>8}{len(net.x):>11}{(time.perf_counter() - start) / repeats:>13.4f}{last:>11.1e}")
