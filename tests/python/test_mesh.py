# SPDX-License-Identifier: Apache-2.0
"""connectivity="mesh": faces of arrays and of clouds, and what is said of wrong ones."""
import numpy as np
import pytest

import pointfair as pf


def sheet(n=30):
    """Points with noise over a grid, and its quads."""
    x, y = np.meshgrid(np.arange(float(n)), np.arange(float(n)), indexing="ij")
    points = np.c_[x.ravel(), y.ravel(), np.zeros(n * n)] + np.random.default_rng(1).normal(0, 0.3, (n * n, 3))
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()[:, None]
    return points, corner + [0, n, n + 1, 1]


def test_faces_of_an_array():
    points, faces = sheet()
    smooth, report = pf.denoise(points, faces=faces, connectivity="mesh", return_report=True)
    assert (report.mesh.faces, report.mesh.vertices, report.mesh.boundary_edges) == (841, 900, 116)
    assert report.mesh.folded_after <= report.mesh.folded_before
    inside = np.ones((30, 30), bool)
    inside[0] = inside[-1] = inside[:, 0] = inside[:, -1] = False
    inside = inside.ravel()
    assert smooth[inside, 2].std() < 0.5 * points[inside, 2].std()
    assert (smooth[~inside] == points[~inside]).all()


def test_quads_and_triangles_of_one_pipeline():
    points, faces = sheet()
    pipeline = pf.Pipeline("cpu")
    pipeline.load(points)
    pipeline.set_faces(faces)
    assert pipeline.run(connectivity="mesh") is not None and pipeline.report.mesh.faces == 841
    pipeline.set_faces(np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]]))
    assert pipeline.run(connectivity="mesh") is not None and pipeline.report.mesh.faces == 1682
    assert pipeline.run() is not None and pipeline.report.mesh is None


@pytest.mark.parametrize("faces, text", [(None, "needs faces"), ([[0, 1, 900]], "corner 900"), ([[0, 1]], "triangles"), ([[0, 1, 2], [0, 1, 2, 3]], "different numbers of corners"),
                                         ([[0, -1, 2]], "from 0"), ([[0.5, 1, 2]], "integers")])
def test_wrong_faces(faces, text):
    with pytest.raises(pf.UsageError, match=text):
        pf.denoise(sheet()[0], faces=faces, connectivity="mesh")


def write_off(path, points, faces):
    rows = [f"OFF\n{len(points)} {len(faces)} 0"] + [" ".join(map(repr, map(float, p))) for p in points]
    path.write_text("\n".join(rows + [" ".join(map(str, (len(f), *f))) for f in faces]) + "\n")
    return path


def test_compare_of_two_meshes(tmp_path):
    points, faces = sheet()
    flat = points * (1, 1, 0)
    noisy, clean = write_off(tmp_path / "noisy.off", points, faces), write_off(tmp_path / "clean.off", flat, faces)
    found = pf.compare(noisy, clean)
    assert found.faces.faces == len(faces) and found.faces.volume is None
    assert 5 < found.faces.normal_error < 60 and found.faces.back_max <= np.abs(points[:, 2]).max() + 1e-5
    assert pf.compare(clean, clean).faces.normal_error < 1e-4
    assert pf.compare(points, clean).faces is None
