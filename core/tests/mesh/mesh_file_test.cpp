// STL and OBJ files: valid variants, exact merging, and an error for every kind of damage.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstring>
#include <palpate/mesh/mesh_file.hpp>
#include <random>
#include <string>

#include "support/mesh_shapes.hpp"

namespace {

using palpate::math::Vector3;
using palpate::mesh::MeshFile;
using palpate::mesh::parse_obj;
using palpate::mesh::parse_stl;
using palpate::mesh::read_mesh_file;
using palpate::mesh::Triangle;
using palpate::mesh::TriangleMesh;
using shapes::Shape;

std::string binary_stl(const Shape& s, const std::string& header = "palpate") {
  std::string out = header + std::string(80 - header.size(), '\0');
  const auto append = [&out](const auto& value) { out.append(reinterpret_cast<const char*>(&value), sizeof value); };
  append(static_cast<std::uint32_t>(s.triangles.size()));
  for (const Triangle& t : s.triangles) {
    for (int k = 0; k < 3; ++k) append(0.0F);
    for (const std::int32_t v : t)
      for (int k = 0; k < 3; ++k) append(static_cast<float>(s.vertices[static_cast<std::size_t>(v)][k]));
    append(std::uint16_t{0});
  }
  return out;
}

std::string ascii_stl(const Shape& s, const char* end_of_line = "\n") {
  std::string out = std::string("solid a facet of nothing") + end_of_line;
  for (const Triangle& t : s.triangles) {
    out += std::string("  facet normal nan 0 0") + end_of_line + " outer loop" + end_of_line;
    for (const std::int32_t v : t) {
      const Vector3<>& x = s.vertices[static_cast<std::size_t>(v)];
      char line[200];
      std::snprintf(line, sizeof line, "vertex %.17g %.17g %.17g", x[0], x[1], x[2]);
      out += line + std::string(end_of_line);
    }
    out += std::string("endloop") + end_of_line + "endfacet" + end_of_line;
  }
  return out + "endsolid a facet of nothing" + end_of_line;
}

/// Expect the triangles of `s` in order, with the coordinates rounded to single precision if asked for.
void expect_same(const MeshFile& mesh, const Shape& s, double unit, bool single) {
  ASSERT_TRUE(mesh.ok()) << mesh.error;
  EXPECT_EQ(mesh.vertices.size(), s.vertices.size()) << "merged";
  ASSERT_EQ(mesh.triangles.size(), s.triangles.size());
  for (std::size_t f = 0; f < s.triangles.size(); ++f)
    for (std::size_t i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) {
        const double x = s.vertices[static_cast<std::size_t>(s.triangles[f][i])][k];
        ASSERT_EQ(mesh.vertices[static_cast<std::size_t>(mesh.triangles[f][i])][k],
                  unit * (single ? static_cast<double>(static_cast<float>(x)) : x));
      }
  EXPECT_TRUE(TriangleMesh(mesh.vertices, mesh.triangles).usable());
}

TEST(MeshFile, ReadsBinaryAndAsciiStl) {
  const Shape s = shapes::ball(5, 0.5, 0.1);
  expect_same(parse_stl(binary_stl(s)), s, 1.0, true);
  expect_same(parse_stl(binary_stl(s, "solid but binary"), 1e-3), s, 1e-3, true);
  expect_same(parse_stl(ascii_stl(s)), s, 1.0, false);
  expect_same(parse_stl(ascii_stl(s, "\r\n"), 1e-3), s, 1e-3, false);
  std::string shouted = ascii_stl(s);
  for (char& c : shouted) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  expect_same(parse_stl(shouted), s, 1.0, false);
}

TEST(MeshFile, MergesEqualCoordinatesOnly) {
  const MeshFile mesh = parse_stl(
      "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
      "facet normal 0 0 1\nouter loop\nvertex -0.0 0 0\nvertex 0 1 0\nvertex 1e-300 0 0\nendloop\nendfacet\nendsolid\n");
  ASSERT_TRUE(mesh) << mesh.error;
  EXPECT_EQ(mesh.vertices.size(), 4U);
  EXPECT_EQ(mesh.triangles[1][0], mesh.triangles[0][0]);
}

TEST(MeshFile, ReadsObj) {
  const MeshFile mesh = parse_obj(
      "# a pyramid\nmtllib none.mtl\no pyramid\nv 0 0 0\nv 1 0 0 1.0\nv +1 1 0 0.5 0.5 0.5\r\nv 0 1 \\\n0\nv .5 .5 1e0\n"
      "vt 0 0\nvn 0 0 1\ns off\nf 4 3 2 1\nf 1/1 2/1 5/1\nf 2//1 3//1 5//1 # inline\nf 3/1/1 4/1/1 5/1/1\nf -2 -5 \\\r\n -1\n\n   \n",
      1e-3);
  ASSERT_TRUE(mesh) << mesh.error;
  ASSERT_EQ(mesh.vertices.size(), 5U);
  EXPECT_EQ(mesh.vertices[3], Vector3<>(0.0, 1e-3, 0.0));
  const std::vector<Triangle> expected = {{3, 2, 1}, {3, 1, 0}, {0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
  EXPECT_EQ(mesh.triangles, expected);
  const TriangleMesh pyramid(mesh.vertices, mesh.triangles);
  EXPECT_TRUE(pyramid.usable());
  EXPECT_NEAR(pyramid.diagnosis().volume, 1e-9 / 3.0, 1e-22);
}

void expect_error(const MeshFile& mesh, const std::string& part) {
  EXPECT_FALSE(mesh.ok());
  EXPECT_TRUE(mesh.triangles.empty());
  EXPECT_NE(mesh.error.find(part), std::string::npos) << mesh.error;
}

TEST(MeshFile, ExplainsDamagedStl) {
  const Shape s = shapes::ball(2, 0.5);
  const std::string binary = binary_stl(s), ascii = ascii_stl(s);
  expect_error(parse_stl(""), "too short");
  expect_error(parse_stl("hello"), "too short");
  expect_error(parse_stl(binary.substr(0, binary.size() - 1)), "announces");
  expect_error(parse_stl(binary_stl(s, "solid").substr(0, 300)), "announces");
  expect_error(parse_stl(binary + "x"), "announces");
  std::string nan = binary;
  const float bad = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(nan.data() + 84 + 50 + 12, &bad, sizeof bad);
  expect_error(parse_stl(nan), "triangle 1: a coordinate is not finite");
  expect_error(parse_stl(ascii.substr(0, ascii.size() / 2)), "export");
  expect_error(parse_stl("solid\nfacet normal 0 0 1 outer loop\nvertex 0 0\nendloop"), "line 4: a vertex needs three finite numbers");
  expect_error(parse_stl("solid\nfacet normal 0 0 1 outer loop\nvertex 0 0 1e999"), "line 3");
  expect_error(parse_stl("solid\nvertex 0 0 0"), "outside a facet");
  expect_error(parse_stl("solid\nfacet normal 0 0 1\nendfacet"), "has 0 corners");
  expect_error(parse_stl("solid\nfacet normal 0 0 1\nfacet"), "inside a facet");
  expect_error(parse_stl("solid\nloop\\\n"), "unknown keyword");
  expect_error(parse_stl(binary, 0.0), "unit");
  expect_error(parse_stl(binary, std::nan("")), "unit");
  expect_error(parse_stl("solid\nfacet normal 0 0 1\nvertex 1e300 0 0 vertex 0 1 0 vertex 0 0 1 endfacet", 1e10), "too large");
}

TEST(MeshFile, ExplainsDamagedObj) {
  expect_error(parse_obj("v 0 0\n"), "line 1: a vertex needs three finite numbers");
  expect_error(parse_obj("v 0 0 nan\n"), "found 'nan'");
  expect_error(parse_obj("v 0 0 0\nf 1 1\n"), "line 2: a face has 2 vertices");
  expect_error(parse_obj("v 0 0 0\nf 1 x 1\n"), "found 'x'");
  expect_error(parse_obj("v 0 0 0\nf 1 0 1\n"), "index 0 is out of range");
  expect_error(parse_obj("v 0 0 0\nf 1 -2 1\n"), "index -2 is out of range");
  expect_error(parse_obj("v 0 0 0\nf 1 99999999999 1\n"), "out of range");
  expect_error(parse_obj("v 0 0 0\nf 1 2 3\n"), "line 2: the vertex index 3 exceeds the 1 vertices");
  expect_error(parse_obj("v 0 0 0\n", -1.0), "unit");
}

TEST(MeshFile, RandomDamageNeverCrashes) {
  const Shape s = shapes::ball(2, 0.5);
  const std::string obj = "v 0 0 0\nv 1 0 0\nv 0 1 \\\n0\nf 1/2/3 2 -1\n";
  std::mt19937_64 random(12);
  for (const std::string& text : {binary_stl(s), ascii_stl(s), obj})
    for (int k = 0; k < 2000; ++k) {
      std::string damaged = text;
      for (int n = 0; n < 3; ++n) damaged[random() % damaged.size()] = static_cast<char>(random() % 256);
      if (k % 4 == 0) damaged.resize(random() % damaged.size());
      for (const MeshFile& mesh : {parse_stl(damaged), parse_obj(damaged)}) {
        for (const Triangle& t : mesh.triangles)
          for (const std::int32_t v : t) ASSERT_LT(static_cast<std::size_t>(v), mesh.vertices.size());
        if (!mesh) {
          ASSERT_TRUE(mesh.vertices.empty());
        }
      }
    }
}

TEST(MeshFile, ReadsFromDisk) {
  const std::string folder = testing::TempDir();
  const Shape s = shapes::ball(2, 0.5);
  const std::string path = folder + "palpate_mesh_file_test.STL";
  {
    std::FILE* file = std::fopen(path.c_str(), "wb");
    ASSERT_NE(file, nullptr);
    const std::string bytes = binary_stl(s);
    std::fwrite(bytes.data(), 1, bytes.size(), file);
    std::fclose(file);
  }
  expect_same(read_mesh_file(path, 1e-3), s, 1e-3, true);
  std::remove(path.c_str());
  expect_error(read_mesh_file(path), path + ": the file cannot be opened");
  expect_error(read_mesh_file("mesh.ply"), "mesh.ply: the format '.ply' is not supported");
  expect_error(read_mesh_file("some.stl/mesh"), "the format '' is not supported");
}

}  // namespace
