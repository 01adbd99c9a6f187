// Random meshes and random paths. Three properties, each checked against all faces by brute force:
//   no pop-through: the proxy is never inside, and a tip inside is always in contact;
//   no stick: without friction no face at the proxy has a point nearer to the tip, and with friction the tip is inside the cone;
//   no iteration limit: every tick converges.
// PALPATE_ROUNDS=1000 runs ten million ticks.
#include <gtest/gtest.h>

#include "support/mesh_shapes.hpp"
#include "support/rounds.hpp"

namespace {

using palpate::math::Vector3;
using palpate::mesh::Proxy;
using palpate::mesh::Surface;
using shapes::Shape;
using shapes::World;

struct Case {
  const char* name;
  Shape shape;
  bool open = false;
};

Vector3<> gaussian(std::mt19937_64& random) {
  std::normal_distribution<double> n;
  return {n(random), n(random), n(random)};
}

std::vector<Case> cases(std::mt19937_64& random) {
  std::uniform_real_distribution<double> u(0.0, 1.0);
  const double bump = 0.3 * u(random), tilt = u(random);
  const auto wave = [bump](double x, double y) { return bump * std::sin(5.0 * x) * std::sin(4.0 * y + x); };
  std::vector<Case> list;
  list.push_back({"bumpy", shapes::ball(6, 0.5, bump)});
  list.push_back({"concave", shapes::moved(shapes::ball(5, 0.5), [&](const Vector3<>& v) {
                    return Vector3<>(v[0], v[1], v[2] - 0.8 * std::exp(-8.0 * (v[0] * v[0] + v[1] * v[1])) * (v[2] > 0.0 ? 1.0 : 0.0));
                  })});
  list.push_back({"random", shapes::moved(shapes::ball(3, 0.5), [&](const Vector3<>& v) { return Vector3<>(v * (0.5 + u(random))); })});
  list.push_back({"thin", shapes::box({0.5, 0.5, 1e-4}, 4)});
  list.push_back({"box", shapes::box({0.5, 0.3, 0.4}, 2)});
  list.push_back({"slivers", shapes::moved(shapes::ball(6, 0.5, 0.5 * bump),
                                           [&](const Vector3<>& v) { return Vector3<>(v[0], 0.02 * v[1] + tilt * v[0], v[2]); })});
  list.push_back({"sheet", shapes::sheet(10, 0.5, wave), true});
  return list;
}

/// Tip on a filtered random walk through and around the mesh, with rare jumps.
struct Wanderer {
  Vector3<> x, v = Vector3<>::Zero();
  double size;
  Vector3<> next(std::mt19937_64& random) {
    std::uniform_real_distribution<double> u(0.0, 1.0);
    v = 0.98 * v + 0.002 * size * gaussian(random) - 0.0008 * x;
    x += v;
    if (u(random) < 1e-3) x = 0.4 * size * gaussian(random);
    return x;
  }
};

void wander(const Case& c, std::uint64_t seed, double scale, double friction, double radius, double shading, int ticks) {
  SCOPED_TRACE(testing::Message() << c.name << " seed " << seed << " scale " << scale << " friction " << friction << " radius " << radius
                                  << " shading " << shading);
  std::mt19937_64 random(seed);
  const Vector3<> offset = 0.3 * scale * gaussian(random);
  Surface surface;
  surface.static_friction = friction;
  surface.dynamic_friction = 0.7 * friction;
  surface.shading = shading;
  const World world(shapes::moved(c.shape, [&](const Vector3<>& v) { return Vector3<>(scale * v + offset); }), surface, c.open);
  ASSERT_TRUE(world.mesh.usable());
  Proxy proxy = world.proxy(radius * scale);
  Wanderer tip{.x = Vector3<>(0.0, 0.0, 1.2), .size = 1.0};
  const double tolerance = 1e-9 * scale;
  for (int k = 0; k < ticks; ++k) {
    const Vector3<> at = scale * tip.next(random) + offset;
    const palpate::mesh::Contact contact = proxy.step(at);
    const shapes::ReferenceDistance proxy_distance = shapes::reference_distance(world.mesh, contact.position);
    ASSERT_FALSE(!c.open && proxy_distance.inside && proxy_distance.distance > tolerance) << "proxy inside at tick " << k;
    ASSERT_GE(proxy_distance.distance, radius * scale * (1.0 - 1e-9) - tolerance) << "at tick " << k;
    if (!contact.touching) {
      ASSERT_EQ(contact.position, at) << "tick " << k;
      ASSERT_FALSE(!c.open && shapes::reference_distance(world.mesh, at).inside) << "contact lost at tick " << k;
    } else if (radius == 0.0) {
      ASSERT_LE(proxy_distance.distance, tolerance) << "at tick " << k;
    }
    const double distance = (contact.position - at).norm();
    if (contact.touching && friction == 0.0 && radius == 0.0 && shading == 0.0) {
      for (std::int32_t f = 0; f < world.mesh.size(); ++f) {
        const palpate::mesh::Face& face = world.mesh.face(f);
        if ((palpate::mesh::nearest_point(face, contact.position).point - contact.position).norm() > 1e-13 * scale) continue;
        ASSERT_GE((palpate::mesh::nearest_point(face, at).point - at).norm(), distance - tolerance)
            << "stuck at tick " << k << " face " << f;
      }
    }
    if (contact.touching) {
      const double depth = contact.normal.dot(contact.position - at);
      ASSERT_NEAR(depth, contact.depth, 10.0 * tolerance);
      if (shading > 0.0) continue;  // at a crease the face normals decide
      ASSERT_LE((contact.position - at - depth * contact.normal).norm(), friction * contact.depth * (1.0 + 1e-9) + tolerance)
          << "tick " << k;
    }
  }
  ASSERT_EQ(proxy.iteration_limit_count(), 0);
}

void wander_on_all_meshes(double radius, double shading, std::uint64_t seed, int ticks) {
  for (int round = 0; round < rounds(); ++round)
    for (const double scale : {1.0, 1e-3, 1e3}) {
      std::mt19937_64 random(++seed);
      for (const Case& c : cases(random))
        for (const double friction : {0.0, 0.6}) {
          wander(c, ++seed, scale, friction, radius, shading, ticks);
          if (testing::Test::HasFatalFailure()) return;
        }
    }
}

TEST(ProxyRandom, PointNeverSticksOrPopsThrough) {
  wander_on_all_meshes(0.0, 0.0, 0, 100);
}

TEST(ProxyRandom, SphereNeverSticksOrPopsThrough) {
  wander_on_all_meshes(0.03, 0.0, 1'000'000, 60);
}

TEST(ProxyRandom, ShadedPointNeverPopsThrough) {
  wander_on_all_meshes(0.0, 0.4, 2'000'000, 40);
}

TEST(ProxyRandom, ShadedSphereNeverPopsThrough) {
  wander_on_all_meshes(0.03, 0.4, 3'000'000, 40);
}

}  // namespace
