#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "palpate/mesh/triangle.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// Axis-aligned bounding box, m.
struct Aabb {
  Vector3<> low = Vector3<>::Constant(std::numeric_limits<double>::infinity());
  Vector3<> high = Vector3<>::Constant(-std::numeric_limits<double>::infinity());

  void add(const Vector3<>& x) noexcept {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  void add(const Aabb& b) noexcept {
    low = low.cwiseMin(b.low);
    high = high.cwiseMax(b.high);
  }
  [[nodiscard]] double distance2(const Vector3<>& x) const noexcept { return (low - x).cwiseMax(x - high).cwiseMax(0.0).squaredNorm(); }
};

/// Bounding volume hierarchy of axis-aligned boxes over the faces of a mesh.
///
/// Faces are sorted along a Morton curve and split at its bits (Lauterbach et al. 2009). The build
/// takes linear time. The tree stores face indices only; queries take the mesh that it was built
/// from. The tree of a mesh that is not usable() is empty, and its queries find nothing.
class AabbTree {
 public:
  AabbTree() = default;

  explicit AabbTree(const TriangleMesh& mesh) {
    if (!mesh.usable()) return;
    const auto count = static_cast<std::size_t>(mesh.size());
    order_ = morton_order(mesh);
    nodes_.reserve(count / 2 + 2);
    leaf_of_.resize(count);
    nodes_.emplace_back();
    parents_.assign(1, -1);
    split(mesh, 0, 0, count, 62);
    codes_ = {};
    nodes_.shrink_to_fit();
    refit(mesh);
  }

  /// Deleted: a query needs the mesh that the tree was built from.
  explicit AabbTree(const TriangleMesh&& mesh) = delete;

  /// Return whether the tree has no faces, so that every query finds nothing.
  [[nodiscard]] bool empty() const noexcept { return nodes_.empty(); }

  /// Refit all boxes to moved vertices. The topology of the tree is unchanged.
  void refit(const TriangleMesh& mesh) noexcept {
    for (std::size_t n = nodes_.size(); n-- > 0;) fit_boxes(mesh, nodes_[n]);
  }

  /// Refit the boxes above the faces [first, last) only.
  template <class Iterator>
  void refit(const TriangleMesh& mesh, Iterator first, Iterator last) noexcept {
    if (nodes_.empty()) return;
    for (; first != last; ++first) {
      for (std::int32_t n = leaf_of_[static_cast<std::size_t>(*first)]; n >= 0; n = parents_[static_cast<std::size_t>(n)])
        if (!fit_boxes(mesh, nodes_[static_cast<std::size_t>(n)])) break;
    }
  }

  struct Nearest {
    std::int32_t face = TriangleMesh::none;  ///< none: no face within the bound
    NearestPoint at{};
    double distance2 = std::numeric_limits<double>::infinity();  ///< squared distance, m^2; the bound if no face was found

    [[nodiscard]] bool found() const noexcept { return face != TriangleMesh::none; }
  };

  /// Return the face nearest to `x` [m] among those closer than sqrt(bound2) [m].
  ///
  /// The result has face == TriangleMesh::none if there is no such face, if the tree is empty, or
  /// if `x` is not finite or so large that its squared distance overflows.
  [[nodiscard]] Nearest nearest(const TriangleMesh& mesh, const Vector3<>& x,
                                double bound2 = std::numeric_limits<double>::infinity()) const noexcept {
    Nearest best;
    best.distance2 = bound2;
    if (nodes_.empty() || !x.allFinite()) return best;
    Stack stack;
    stack.push(0, 0.0);
    while (!stack.empty()) {
      const auto [index, lower_bound] = stack.pop();
      if (lower_bound >= best.distance2) continue;
      const Node& node = nodes_[static_cast<std::size_t>(index)];
      double d[2] = {node.box[0].distance2(x), node.box[1].distance2(x)};
      const std::size_t near = d[1] < d[0] ? 1 : 0;
      for (const std::size_t k : {1 - near, near})
        if (node.count[k] == 0 && d[k] < best.distance2) stack.push(node.child[k], d[k]);
      for (const std::size_t k : {near, 1 - near}) {
        if (!(d[k] < best.distance2)) continue;
        for (std::int32_t i = 0; i < node.count[k]; ++i) {
          const std::int32_t f = order_[static_cast<std::size_t>(node.child[k] + i)];
          const NearestPoint p = nearest_point(mesh.face(f), x);
          const double d2 = (x - p.point).squaredNorm();
          if (d2 < best.distance2) best = {f, p, d2};
        }
      }
    }
    return best;
  }

  /// Call visit(face) for every face whose box is within `distance` [m] of `x` [m].
  ///
  /// Return false if there is no such face, if the tree is empty or if `x` is not finite.
  template <class Visit>
  // NOLINTNEXTLINE(modernize-use-nodiscard): most callers need the visits only
  bool overlap_sphere(const Vector3<>& x, double distance, Visit visit) const noexcept {
    if (nodes_.empty() || !x.allFinite()) return false;
    bool found = false;
    const double bound2 = distance * distance * (1.0 + 1e-14);
    std::array<std::int32_t, 100> stack;
    std::size_t size = 0;
    stack[size++] = 0;
    while (size > 0) {
      const Node& node = nodes_[static_cast<std::size_t>(stack[--size])];
      for (std::size_t k = 0; k < 2; ++k) {
        if (!(node.box[k].distance2(x) <= bound2)) continue;
        if (node.count[k] == 0) {
          stack[size++] = node.child[k];
        } else {
          found = true;
          for (std::int32_t i = 0; i < node.count[k]; ++i) visit(order_[static_cast<std::size_t>(node.child[k] + i)]);
        }
      }
    }
    return found;
  }

  /// Call visit(face, end) for every face whose box is within `radius` [m] of the segment from + t
  /// motion [m], 0 <= t <= end.
  ///
  /// Nearer boxes come first. `end` starts at 1, and `visit` may lower it to the first hit. Return
  /// false if no face was visited, if the tree is empty or if `from` or `motion` is not
  /// finite.
  template <class Visit>
  // NOLINTNEXTLINE(modernize-use-nodiscard): most callers need the visits only
  bool sweep_sphere(const Vector3<>& from, const Vector3<>& motion, double radius, Visit visit) const noexcept {
    if (nodes_.empty() || !from.allFinite() || !motion.allFinite()) return false;
    bool found = false;
    double end = 1.0;
    Vector3<> inverse;
    for (int i = 0; i < 3; ++i) inverse[i] = motion[i] != 0.0 ? 1.0 / motion[i] : 1e300;
    const Vector3<> margin = Vector3<>::Constant(radius);
    const double length = motion.norm();
    const auto entry = [&](const Aabb& box) {
      const double half = 0.5 * end, reach = radius + half * length;  // the segment lies in a ball about its midpoint
      if (box.distance2(from + half * motion) > reach * reach * (1.0 + 1e-14)) return 2.0;
      const Vector3<> one = (box.low - margin - from).cwiseProduct(inverse), two = (box.high + margin - from).cwiseProduct(inverse);
      const double in = std::max(one.cwiseMin(two).maxCoeff(), 0.0), out = std::min(one.cwiseMax(two).minCoeff(), end);
      return in <= out * (1.0 + 1e-15) ? in : 2.0;
    };
    Stack stack;
    stack.push(0, 0.0);
    while (!stack.empty()) {
      const auto [index, lower_bound] = stack.pop();
      if (lower_bound > end) continue;
      const Node& node = nodes_[static_cast<std::size_t>(index)];
      const double t[2] = {entry(node.box[0]), entry(node.box[1])};
      const std::size_t near = t[1] < t[0] ? 1 : 0;
      for (const std::size_t k : {1 - near, near})
        if (node.count[k] == 0 && t[k] <= end) stack.push(node.child[k], t[k]);
      for (const std::size_t k : {near, 1 - near})
        if (t[k] <= end)
          for (std::int32_t i = 0; i < node.count[k]; ++i) {
            found = true;
            visit(order_[static_cast<std::size_t>(node.child[k] + i)], end);
          }
    }
    return found;
  }

 private:
  static constexpr std::size_t leaf_size = 4;

  struct alignas(64) Node {
    std::array<Aabb, 2> box;
    std::array<std::int32_t, 2> child{};  // child node, or first index of a leaf in order_
    std::array<std::int32_t, 2> count{};  // faces of a leaf; 0 for an inner node
  };

  /// The depth is bounded by the 63 bits of the code plus 31 halvings of equal codes. Two children
  /// each.
  struct Stack {
    std::array<std::pair<std::int32_t, double>, 200> items;
    std::size_t size = 0;
    void push(std::int32_t node, double key) noexcept { items[size++] = {node, key}; }
    std::pair<std::int32_t, double> pop() noexcept { return items[--size]; }
    [[nodiscard]] bool empty() const noexcept { return size == 0; }
  };

  static std::uint64_t spread_bits(std::uint64_t x) noexcept {  // 21 bits, two zeros between adjacent bits
    x &= 0x1fffff;
    x = (x | x << 32) & 0x1f00000000ffffULL;
    x = (x | x << 16) & 0x1f0000ff0000ffULL;
    x = (x | x << 8) & 0x100f00f00f00f00fULL;
    x = (x | x << 4) & 0x10c30c30c30c30c3ULL;
    return (x | x << 2) & 0x1249249249249249ULL;
  }

  /// Return the faces in the order of their centroids on the curve; store the sorted codes in
  /// codes_.
  std::vector<std::int32_t> morton_order(const TriangleMesh& mesh) {
    const auto count = static_cast<std::size_t>(mesh.size());
    Aabb all;
    for (std::int32_t f = 0; f < mesh.size(); ++f) all.add(centroid(mesh.face(f)));
    const double size = count > 0 ? (all.high - all.low).maxCoeff() : 0.0;
    const double scale = size > 0.0 ? 2097151.0 / size : 0.0;
    using Pair = std::pair<std::uint64_t, std::int32_t>;
    std::vector<Pair> pairs(count), other(count);
    for (std::size_t f = 0; f < count; ++f) {
      const Vector3<> x = (centroid(mesh.face(static_cast<std::int32_t>(f))) - all.low) * scale;
      const auto cell = [](double v) { return spread_bits(static_cast<std::uint64_t>(v)); };
      pairs[f] = {cell(x[0]) << 2 | cell(x[1]) << 1 | cell(x[2]), static_cast<std::int32_t>(f)};
    }
    for (int shift = 0; shift < 66; shift += 11) {  // radix sort, eleven bits per pass
      std::array<std::size_t, 2049> begin{};
      for (const Pair& p : pairs) ++begin[(p.first >> shift & 2047) + 1];
      for (std::size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
      for (const Pair& p : pairs) other[begin[p.first >> shift & 2047]++] = p;
      std::swap(pairs, other);
    }
    std::vector<std::int32_t> order(count);
    codes_.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      codes_[i] = pairs[i].first;
      order[i] = pairs[i].second;
    }
    return order;
  }

  static Vector3<> centroid(const Face& f) noexcept { return (f.corner[0] + f.corner[1] + f.corner[2]) / 3.0; }

  /// Split the faces [first, last) of `node` where `bit` of their codes changes, or in the middle
  /// if no bit changes.
  void split(const TriangleMesh& mesh, std::int32_t node, std::size_t first, std::size_t last, int bit) {
    std::size_t mid = first;
    while (bit >= 0 && (mid == first || mid == last)) {
      const std::uint64_t mask = std::uint64_t{1} << bit;
      if ((codes_[first] ^ codes_[last - 1]) & mask) {
        mid = static_cast<std::size_t>(std::partition_point(codes_.begin() + static_cast<std::ptrdiff_t>(first),
                                                            codes_.begin() + static_cast<std::ptrdiff_t>(last),
                                                            [mask](std::uint64_t c) { return (c & mask) == 0; }) -
                                       codes_.begin());
      }
      --bit;
    }
    if (mid == first || mid == last) mid = first + (last - first) / 2;
    std::array<std::pair<std::size_t, std::size_t>, 2> halves{{{first, mid}, {mid, last}}};
    if (last - first == 1) halves[0] = halves[1];  // a mesh of one face
    for (std::size_t k = 0; k < 2; ++k) {
      const auto [begin, end] = halves[k];
      if (end - begin <= leaf_size) {
        nodes_[static_cast<std::size_t>(node)].child[k] = static_cast<std::int32_t>(begin);
        nodes_[static_cast<std::size_t>(node)].count[k] = static_cast<std::int32_t>(end - begin);
        for (std::size_t i = begin; i < end; ++i) leaf_of_[static_cast<std::size_t>(order_[i])] = node;
        continue;
      }
      const auto child = static_cast<std::int32_t>(nodes_.size());
      nodes_.emplace_back();
      parents_.push_back(node);
      nodes_[static_cast<std::size_t>(node)].child[k] = child;
      split(mesh, child, begin, end, bit);
    }
  }

  /// Fit both boxes of a node to its children. Return true if they changed. Children follow their
  /// parents in nodes_.
  bool fit_boxes(const TriangleMesh& mesh, Node& node) noexcept {
    bool changed = false;
    for (std::size_t k = 0; k < 2; ++k) {
      Aabb box;
      if (node.count[k] == 0) {
        const Node& child = nodes_[static_cast<std::size_t>(node.child[k])];
        box = child.box[0];
        box.add(child.box[1]);
      } else {
        for (std::int32_t i = 0; i < node.count[k]; ++i)
          for (const Vector3<>& x : mesh.face(order_[static_cast<std::size_t>(node.child[k] + i)]).corner) box.add(x);
      }
      changed = changed || box.low != node.box[k].low || box.high != node.box[k].high;
      node.box[k] = box;
    }
    return changed;
  }

  std::vector<Node> nodes_;
  std::vector<std::int32_t> order_;    // faces, leaf by leaf
  std::vector<std::int32_t> parents_;  // of each node
  std::vector<std::int32_t> leaf_of_;  // node of the leaf of each face
  std::vector<std::uint64_t> codes_;   // used during the build only
};

}  // namespace palpate::mesh
