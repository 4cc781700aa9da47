"""PyVista's plotters: clpeel covers the pixels that PyVista covers; options, lights and notes say the rest."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import plainly
import pytest
from numpy.typing import NDArray
from reading import plots

import clpeel
from clpeel.scene.lights import AmbientLight, DirectionalLight, PointLight, SpotLight

pv = pytest.importorskip("pyvista", reason="needs the package pyvista: pip install 'clpeel[test-ecosystem]'")


def covered(image: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Where a picture is not its background."""
    found: NDArray[np.bool_] = (image[..., :3] != np.array([0, 64, 0], np.uint8)).any(axis=-1)
    return found


def inner(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The pixels of a mask whose eight neighbours are in it, too."""
    wide = np.pad(mask, 1, mode="edge")
    height, width = mask.shape
    parts = [wide[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.logical_and.reduce(parts)


@pytest.mark.parametrize("name", plots.MADE)
def test_the_same_pixels_are_covered(name: str, tmp_path: Path) -> None:
    theirs = covered(plots.by_pyvista(name, tmp_path))
    scene, camera, options = clpeel.from_pyvista(plots.MADE[name]())
    ours = covered(plainly.render(scene, camera, **options).image)
    assert ours.shape == theirs.shape and 0.05 < theirs.mean() < 0.9
    assert not (inner(theirs) & ~ours).any() and not (inner(~theirs) & ours).any()
    assert (ours != theirs).sum() <= 0.01 * theirs.sum()


def only(**options: Any) -> Any:
    """What a plotter of one sphere becomes."""
    plot = plots.plotter()
    plot.add_mesh(pv.Sphere(), **options)
    return clpeel.from_pyvista(plot)


# --- meshes -----------------------------------------------------------------------------------------------------------


def test_colors_and_opacity_are_those_of_the_property() -> None:
    scene, _, _ = only(color=(51, 102, 153), opacity=0.25)
    np.testing.assert_allclose(scene.color, [0.2, 0.4, 0.6, 0.25], rtol=1e-6)


def of_two_colors(of: str, before_map: bool = True, **options: Any) -> Any:
    """A plotter of two squares whose points, or cells, count up and end with NaN, in two colours and a third."""
    plot, mesh = plots.plotter(), pv.Plane(i_resolution=2, j_resolution=1)
    values = np.arange(mesh.n_points if of == "points" else mesh.n_cells, dtype=float)
    values[-1] = math.nan
    mesh[of] = values
    colors = {"cmap": ["#ff0000", "#0000ff"], "n_colors": 2, "nan_color": "#00ff00", "lighting": False}
    plot.add_mesh(mesh, scalars=of, interpolate_before_map=before_map, show_scalar_bar=False, **colors, **options)
    return plot


RED, BLUE, GREEN = [255, 0, 0, 51], [0, 0, 255, 51], [0, 255, 0, 51]


def test_scalars_of_cells_have_the_colors_of_the_lookup_table() -> None:
    scene, _, _ = clpeel.from_pyvista(of_two_colors("cells", opacity=0.2))
    assert scene.face_colors is not None and scene.face_colors.tolist() == [RED, RED, GREEN, GREEN]


def test_scalars_that_are_mapped_at_the_points_have_their_colors_there() -> None:
    scene, _, _ = clpeel.from_pyvista(of_two_colors("points", before_map=False, opacity=0.2))
    assert scene.vertex_colors is not None  # 0 to 4 in two halves, then NaN
    assert scene.vertex_colors.tolist() == [RED, RED, BLUE, BLUE, BLUE, GREEN]


def test_scalars_of_points_are_looked_up_between_these() -> None:
    scene, camera, options = clpeel.from_pyvista(of_two_colors("points"))
    (found,) = scene.color_maps
    assert found.colors.tolist() == [[255, 0, 0, 255], [0, 0, 255, 255]] and found.clim == (0, 4)
    assert found.nan == (0, 255, 0, 255) and found.label == "points" and scene.vertex_arrays == {}
    image = plainly.render(scene, camera, **options).image
    shown = {tuple(int(level) for level in color[:3]) for color in np.unique(image.reshape(-1, 4), axis=0)}
    assert shown == {(255, 0, 0), (0, 0, 255), (0, 255, 0), (0, 64, 0)}  # no colour in between, and the background


def test_a_logarithmic_range_and_colors_beyond_it_are_kept() -> None:
    plot, mesh = plots.plotter(), pv.Plane(i_resolution=1, j_resolution=1)
    mesh["far"] = np.array([0.1, 1, 10, 1000])
    ends = {"below_color": "black", "above_color": "white"}
    plot.add_mesh(mesh, scalars="far", log_scale=True, clim=(1, 100), show_scalar_bar=False, **ends)
    (found,) = clpeel.from_pyvista(plot)[0].color_maps
    assert found.log_scale and found.clim == (1, 100)
    assert found.below == (0, 0, 0, 255) and found.above == (255, 255, 255, 255)


def test_scalars_that_are_colors_are_left_as_they_are() -> None:
    plot, mesh = plots.plotter(), pv.Plane(i_resolution=1, j_resolution=1)
    mesh["own"] = np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9], [10, 11, 12]], np.uint8)
    plot.add_mesh(mesh, scalars="own", rgb=True)
    scene, _, _ = clpeel.from_pyvista(plot)
    assert scene.vertex_colors is not None
    assert scene.vertex_colors.tolist() == [[1, 2, 3, 255], [4, 5, 6, 255], [7, 8, 9, 255], [10, 11, 12, 255]]


def test_the_plotter_stays_as_it_is() -> None:
    plot = plots.nested()
    mapper = plot.actors[next(iter(plot.actors))].mapper
    before = mapper.GetInterpolateScalarsBeforeMapping(), mapper.GetInputDataObject(0, 0)
    clpeel.from_pyvista(plot)
    assert (mapper.GetInterpolateScalarsBeforeMapping(), mapper.GetInputDataObject(0, 0)) == before


def test_invisible_actors_are_left_out() -> None:
    plot = plots.plotter()
    plot.add_mesh(pv.Sphere()).visibility = False
    plot.add_mesh(pv.Cube())
    scene, _, _ = clpeel.from_pyvista(plot)
    assert scene.counts == (12, 0, 0)


def test_wires_are_lines_without_the_diagonals_of_polygons() -> None:
    plot = plots.plotter()
    plot.add_mesh(pv.Cube(), style="wireframe", color="red", line_width=3)
    scene, _, options = clpeel.from_pyvista(plot)
    assert scene.counts == (0, 12, 0) and options["line_width"] == 3
    assert scene.lines is not None and scene.bounds.tolist() == [[-0.5] * 3, [0.5] * 3]
    ends = scene.vertices[scene.lines]
    np.testing.assert_allclose(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1), 1)
    assert (scene.colors[..., :3] == [1, 0, 0]).all()


@pytest.mark.parametrize(("spheres", "kind"), [(False, "square"), (True, "sphere")])
def test_points_have_their_size_and_kind(spheres: bool, kind: str) -> None:
    scene, _, options = only(style="points", point_size=7, render_points_as_spheres=spheres)
    assert scene.counts == (0, 0, 842) and options["point_size"] == 7 and options["point_type"] == kind


def test_flat_faces_have_the_normals_of_their_planes() -> None:
    scene, _, _ = only(smooth_shading=False)
    assert scene.vertex_normals is not None
    corners = scene.vertices[scene.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    cosines = np.einsum("mkc,mc->mk", scene.vertex_normals[scene.faces], across)
    assert cosines.min() > 1 - 1e-4
    smooth, _, _ = only(smooth_shading=True)
    assert smooth.vertex_normals is not None
    units = smooth.vertices / np.linalg.norm(smooth.vertices, axis=1, keepdims=True)
    assert (units * smooth.vertex_normals).sum(axis=1).min() > 0.99


@pytest.mark.parametrize(("culling", "outside"), [("back", 1), ("front", -1)])
def test_culled_faces_are_single_sided(culling: str, outside: int) -> None:
    scene, _, _ = only(culling=culling)
    assert scene.single_sided is not None and scene.single_sided.all()
    corners = scene.vertices[scene.faces]
    volume = np.einsum("mc,mc->m", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()
    assert np.sign(volume) == outside


def test_edges_are_an_option_if_all_meshes_have_them() -> None:
    plot = plots.plotter()
    plot.add_mesh(pv.Cube(), show_edges=True, edge_color="red", edge_opacity=0.5, opacity=0.5, line_width=2)
    scene, _, options = clpeel.from_pyvista(plot)
    assert options["edges"] is True and options["edge_color"] == (1, 0, 0) and options["edge_opacity"] == 0.25
    assert options["line_width"] == 2 and scene.notes == ()
    plot.add_mesh(pv.Sphere())
    scene, _, options = clpeel.from_pyvista(plot)
    assert "edges" not in options and any("edges of 1 mesh" in note for note in scene.notes)


def test_a_texture_comes_with_its_mesh() -> None:
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 0] = (255, 0, 0)  # the upper left corner of the image, as PyVista shows it
    plot = plots.plotter()
    plot.add_mesh(pv.Plane(i_resolution=1, j_resolution=1), texture=pv.Texture(pixels), lighting=False)
    scene, _, options = clpeel.from_pyvista(plot)
    assert options["lighting"] == "none" and scene.uv is not None and scene.materials[0].texture is not None
    upper_left = np.argmin(scene.vertices[:, 0] - scene.vertices[:, 1])
    assert scene.uv[upper_left].tolist() == [0, 0]
    assert scene.materials[0].texture.image[0, 0].tolist() == [255, 0, 0, 255]


def test_physically_based_meshes_have_their_finish() -> None:
    scene, _, _ = only(pbr=True, metallic=0.75, roughness=0.25, color="white")
    (material,) = scene.materials
    assert material.plain and material.finish is not None
    assert material.finish.metallic == 0.75 and material.finish.roughness == 0.25


# --- light ------------------------------------------------------------------------------------------------------------


def lit(*lights: Any, **options: Any) -> Any:
    """A plotter of a white plane that faces the camera, with these lights alone."""
    plot = plots.plotter(lighting="none")
    plot.add_mesh(pv.Plane(i_size=20, j_size=20), color="white", **options)
    for light in lights:
        plot.add_light(light)
    plot.camera_position = [(0, 0, 5), (0, 0, 0), (0, 1, 0)]
    return plot


def middle(plot: Any) -> NDArray[np.uint8]:
    """The colour in the middle of clpeel's picture of a plotter."""
    scene, camera, options = clpeel.from_pyvista(plot)
    image = plainly.render(scene, camera, **options).image
    found: NDArray[np.uint8] = image[image.shape[0] // 2, image.shape[1] // 2, :3]
    return found


def test_what_faces_the_camera_is_as_bright_as_in_vtk() -> None:
    """There VTK's light is the sum of the lights' colours times their intensities and cosines.

    Up to 4 % of the light is in clpeel's highlight, which is off: 2.5 levels of 127.5, as srgb(0.96 x) is.
    """
    one = pv.Light(light_type="camera light", position=(0, 0, 1), intensity=0.5, color=(255, 128, 64))
    np.testing.assert_allclose(middle(lit(one)), [127.5, 64, 32], atol=3)
    other = pv.Light(light_type="scene light", position=(0, 1, 1), intensity=0.25)
    away = pv.Light(light_type="scene light", position=(0, 0, -1), intensity=0.9)
    share = 255 * 0.25 / math.sqrt(2)
    expected = np.array([127.5, 64, 32]) + share
    np.testing.assert_allclose(middle(lit(one, other, away)), expected, atol=4)


def test_lights_with_a_place_are_points_or_spots() -> None:
    point = pv.Light(
        light_type="scene light", position=(0, 3, 4), focal_point=(0, 0, 0), positional=True, intensity=0.5
    )
    point.cone_angle = 90
    scene, _, options = clpeel.from_pyvista(lit(point))
    (found,) = scene.lights
    assert options["lighting"] == "scene" and type(found) is PointLight and found.position == (0, 3, 4)
    np.testing.assert_allclose(middle(lit(point)), 255 * 0.5 * 4 / 5, atol=1.5)
    point.cone_angle = 20
    (found,) = clpeel.from_pyvista(lit(point))[0].lights
    assert type(found) is SpotLight and found.outer_angle == 20
    np.testing.assert_allclose(found.direction, (0, -3, -4))


def test_lights_that_are_off_are_dark() -> None:
    light = pv.Light(light_type="scene light", position=(0, 0, 1))
    light.on = False
    assert middle(lit(light)).tolist() == [0, 0, 0]
    assert clpeel.from_pyvista(lit(light))[0].lights == (AmbientLight(intensity=0.0),)


def test_a_white_headlight_alone_is_that_of_clpeel() -> None:
    scene, _, options = clpeel.from_pyvista(lit(pv.Light(light_type="headlight")))
    assert options["lighting"] == "headlight" and scene.lights == ()


def test_meshes_without_light_keep_their_colors_among_others() -> None:
    plot = lit(pv.Light(light_type="camera light", position=(0, 1, 1), intensity=0.5), opacity=0.999)
    plot.add_mesh(pv.Plane(center=(0, 0, 1)), color=(0.2, 0.4, 0.6), lighting=False)
    np.testing.assert_allclose(middle(plot), [51, 102, 153], atol=1)
    plot.add_mesh(pv.Plane(center=(0, 0, 2)), color=(0.2, 0.4, 0.6))
    assert (middle(plot) < [45, 90, 140]).all()


def test_pyvista_s_default_lights_follow_the_camera() -> None:
    scene, _, options = only()
    assert options["lighting"] == "scene" and len(scene.lights) == 5
    assert all(isinstance(light, DirectionalLight) and light.follows_camera for light in scene.lights)
    assert not any(isinstance(light, DirectionalLight) and light.highlights for light in scene.lights)


# --- the view ---------------------------------------------------------------------------------------------------------


def test_the_camera_is_the_plotter_s() -> None:
    plot = plots.moved()
    _, camera, _ = clpeel.from_pyvista(plot)
    assert camera.position == (3, 4, 5) and camera.focal_point == (0.2, 0.1, 0) and not camera.orthographic
    assert camera.view_angle == pytest.approx(42)
    up = np.array(plot.camera.up)
    assert camera.axes()[1] @ up / np.linalg.norm(up) > 0.5


def test_a_parallel_scale_is_half_the_height() -> None:
    _, camera, _ = clpeel.from_pyvista(plots.parallel())
    assert camera.orthographic
    assert camera.distance * math.tan(math.radians(camera.view_angle) / 2) == pytest.approx(1.7)


def test_background_and_size_are_the_window_s() -> None:
    plot = plots.plotter()
    plot.add_mesh(pv.Cube())
    _, _, options = clpeel.from_pyvista(plot)
    assert (
        options["size"] == plots.SIZE
        and np.allclose(options["background"], (0, 64 / 255, 0))
        and options["samples"] == 1
    )
    plot.set_background("white", top="black")
    plot.enable_anti_aliasing("ssaa")
    scene, _, options = clpeel.from_pyvista(plot)
    assert options["background"] == ((0, 0, 0), (1, 1, 1)) and options["samples"] == 4 and scene.notes == ()


def test_of_subplots_the_active_one_is_taken() -> None:
    plot = plots.plotter(shape=(1, 2))
    plot.add_mesh(pv.Sphere())
    plot.subplot(0, 1)
    plot.add_mesh(pv.Cube())
    scene, _, options = clpeel.from_pyvista(plot)
    assert scene.counts == (12, 0, 0) and options["size"] == (150, 200)
    assert scene.notes == ("1 other subplot(s) left out: plotter.subplot(row, column) chooses one",)


def test_notes_say_what_is_left_out() -> None:
    plot, mesh = plots.plotter(), pv.Sphere()
    mesh["z"] = mesh.points[:, 2]
    plot.add_mesh(mesh, scalars="z", specular=0.5, render_lines_as_tubes=True)
    plot.add_text("words")
    plot.show_bounds()
    plot.add_axes()
    notes = "\n".join(clpeel.from_pyvista(plot)[0].notes)
    for word in (
        "scalar bar (result.with_bar",
        "text left out",
        "axes around the scene",
        "specular=0.5",
        "tubes",
        "with_axis",
    ):
        assert word in notes, word


# --- errors -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: 3, "expected a pyvista.Plotter, got int"),
        (pv.Sphere, "meshes are for clpeel.load"),
        (plots.plotter, "expected a plotter that shows meshes, got none"),
    ],
)
def test_what_is_no_plotter_with_meshes_is_refused(make: Any, message: str) -> None:
    with pytest.raises(clpeel.InputError, match=r"^from_pyvista: ") as error:
        clpeel.from_pyvista(make())
    assert message in str(error.value) and "\n" not in str(error.value)


def test_load_points_from_plotters_to_from_pyvista() -> None:
    with pytest.raises(clpeel.InputError, match=r"clpeel.from_pyvista\(plotter\)"):
        clpeel.load(plots.nested())
