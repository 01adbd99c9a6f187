// Stroke a cube with friction through a sphere of 2 mm. The device gives its tip position and takes a tip force.
#include <cstdio>
#include <palpate/mechanism/tip_device.hpp>
#include <palpate/mesh.hpp>
#include <palpate/servo/servo.hpp>
#include <utility>
#include <vector>

using palpate::math::Vector3;
using palpate::mechanism::TipDevice;
namespace mesh = palpate::mesh;
namespace object = palpate::object;

/// A cube with edges of 40 mm about the origin. read_mesh_file() reads STL and OBJ files.
mesh::TriangleMesh cube() {
  std::vector<Vector3<>> vertices;
  for (int i = 0; i < 8; ++i) vertices.emplace_back((i & 1) != 0 ? 0.02 : -0.02, (i & 2) != 0 ? 0.02 : -0.02, (i & 4) != 0 ? 0.02 : -0.02);
  std::vector<mesh::Triangle> triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                                           {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return {std::move(vertices), std::move(triangles)};
}

int main() {
  const mesh::Surface surface{.stiffness = {500.0}, .static_friction = 0.5, .dynamic_friction = 0.4};  // N/m
  const auto model = object::MeshModel::make(cube(), surface);
  if (!model) {
    std::printf("the mesh is not usable: TriangleMesh::diagnosis() gives the reason\n");
    return 1;
  }
  const palpate::servo::ServoSetup<TipDevice> setup{.start = Vector3<>(-0.01, 0.0, 0.03)};
  palpate::servo::Servo<TipDevice, object::MeshObject> servo(setup, object::MeshObject(model, 0.002));

  // Down to 1 mm inside the top (with the radius of the tip), then 10 mm along x.
  for (int k = 0; k < 50; ++k) servo.tick({-0.01, 0.0, 0.03 - 0.009 * k / 49}, Vector3<>::Zero());
  for (int k = 0; k <= 1000; ++k) {
    const auto& tick = servo.tick({-0.01 + 1e-5 * k, 0.0, 0.021}, Vector3<>::Zero());
    if (k % 200 == 0)
      std::printf("x = %5.1f mm: tangential %.3f N, normal %.3f N, %s\n", 1e3 * tick.tip[0], tick.object_force[0], -tick.object_force[2],
                  servo.object().proxy().sliding() ? "slides" : "sticks");
  }
}
