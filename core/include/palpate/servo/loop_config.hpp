#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "palpate/control/admittance_controller.hpp"
#include "palpate/control/any_controller.hpp"
#include "palpate/control/state_space.hpp"
#include "palpate/control/workspace_controller.hpp"
#include "palpate/guard/any_guard.hpp"
#include "palpate/mechanism/flexible_mechanism.hpp"
#include "palpate/mechanism/registry.hpp"
#include "palpate/object/any_object.hpp"
#include "palpate/servo/blob.hpp"
#include "palpate/servo/config_objects.hpp"
#include "palpate/servo/config_reader.hpp"
#include "palpate/servo/json.hpp"
#include "palpate/servo/simulation.hpp"

namespace palpate::servo {

/// A servo loop resolved to plain data: a folder with `loop.json` and binary blobs, written by `palpate resolve`.
///
/// A loaded config owns its object and its controller. Setups made from it share meshes and body data, and have their own state.
class LoopConfig {
 public:
  static constexpr int version = 2;                   ///< of the format
  static constexpr std::int64_t max_ticks = 1 << 22;  ///< servo periods of a run: 70 minutes at 1 kHz

  std::string title;
  std::string mechanism;  ///< name in mechanism::Registry
  int dof = 0;
  int ticks = 0;                       ///< servo periods of the run
  std::vector<double> reference;       ///< force reference at each sample, (ticks + 1) x 3, N
  std::vector<double> operator_force;  ///< voluntary force at each sample, (ticks + 1) x 3, N

  /// Return the setup for simulate() and Loop, or nothing if the config's mechanism is another one.
  template <class Mechanism>
  [[nodiscard]] std::optional<SimulationSetup<Mechanism>> setup() const {
    if (mechanism != Mechanism::name) return std::nullopt;
    SimulationSetup<Mechanism> out;
    typename Mechanism::Parameters parameters;
    for (const auto& field : Mechanism::parameters)
      for (const auto& [key, values] : parameters_)
        if (key == field.key) field.assign(parameters, values.data());
    out.mechanism = Mechanism(parameters);
    const auto joints = [](const std::vector<double>& values) {
      return Joints<Mechanism::dof>(Eigen::Map<const Joints<Mechanism::dof>>(values.data()));
    };
    out.frozen_kinematics = frozen_kinematics_;
    out.encoder.step = joints(encoder_step_);
    out.limits.peak_force = peak_force_;
    out.limits.continuous_force = continuous_force_;
    out.limits.thermal_time = thermal_time_;
    out.limits.peak_torque = joints(peak_torque_);
    out.delay = delay_;
    out.gravity_compensation = gravity_compensation_;
    out.start = joints(start_);
    out.period = period_;
    out.object = object_;
    out.controller = controller_;
    if constexpr (Mechanism::dof <= 3) {
      if (workspace_ && tool_)
        out.controller = control::AdmittanceController<Mechanism>(out.mechanism, joints(known_friction_), *workspace_, *tool_, period_);
      else if (workspace_)
        out.controller = control::WorkspaceController<Mechanism>(out.mechanism, joints(known_friction_), *workspace_, period_);
    }
    if (passivity_controller_) out.guard = guard::PassivityController<Mechanism>(*passivity_controller_);
    if (half_sample_) out.guard = guard::HalfSample<Mechanism>(*half_sample_);
    if (sample_estimate_hold_) out.guard = guard::SampleEstimateHold<Mechanism>(*sample_estimate_hold_);
    if (!bound_damping_.empty())
      out.guard = guard::EnergyBound<Mechanism>(
          guard::EnergyBoundParameters<Mechanism::dof>{joints(bound_damping_), joints(bound_coulomb_), lateness_});
    out.friction.viscous = joints(viscous_);
    out.friction.coulomb = joints(coulomb_);
    out.friction.breakaway = joints(breakaway_);
    out.friction.stribeck_speed = joints(stribeck_speed_);
    out.human_arm = human_arm_;
    out.flexible = flexible_;
    out.fixed = fixed_;
    out.linear = linear_;
    out.plant_a = plant_a_;
    out.plant_b = plant_b_;
    out.plant_c = plant_c_;
    out.working_torque = joints(working_torque_);
    out.jitter = jitter_;
    out.seed = seed_;
    out.start_speed = joints(start_speed_);
    out.substeps = substeps_;
    out.record_every = record_every_;
    out.speed_limit = speed_limit_;
    return out;
  }

  /// Return the number of rows that simulate() records, unless the loop diverges.
  [[nodiscard]] int max_rows() const noexcept { return ticks / record_every_ + 1; }
  [[nodiscard]] double period() const noexcept { return period_; }  ///< s

 private:
  friend class LoopConfigLoader;

  std::vector<std::pair<std::string, std::vector<double>>> parameters_;
  bool frozen_kinematics_ = false, fixed_ = false, linear_ = false;
  int delay_ = 0, substeps_ = 1, record_every_ = 1;
  double period_ = 1e-3, jitter_ = 0.0, speed_limit_ = 0.0;
  std::uint64_t seed_ = 0;
  double peak_force_ = 0.0, continuous_force_ = 0.0, thermal_time_ = 1.0;
  std::vector<double> encoder_step_, peak_torque_, start_, start_speed_, working_torque_;
  std::vector<double> viscous_, coulomb_, breakaway_, stribeck_speed_;
  Vector3<> gravity_compensation_ = Vector3<>::Zero();
  plant::HumanArm human_arm_;
  std::optional<mechanism::FlexibleMode> flexible_;
  Eigen::MatrixXd plant_a_, plant_b_, plant_c_;
  object::AnyObject object_;
  control::AnyController controller_;
  std::optional<control::WorkspaceParameters> workspace_;
  std::optional<control::VirtualTool> tool_;  // of an admittance display, whose feedback is workspace_
  std::vector<double> known_friction_;
  std::optional<guard::PassivityControllerParameters> passivity_controller_;
  std::optional<guard::HalfSampleParameters> half_sample_;
  std::optional<guard::SampleEstimateHoldParameters> sample_estimate_hold_;
  std::vector<double> bound_damping_, bound_coulomb_;  // of an energy bound; empty: none
  double lateness_ = 0.0;
};

/// A loaded config, or the reason why there is none.
struct LoopConfigResult {
  std::optional<LoopConfig> config;
  std::string error;  ///< empty on success; otherwise the problem, the place and the remedy

  [[nodiscard]] explicit operator bool() const noexcept { return config.has_value(); }
};

/// Fills a LoopConfig; see load_loop_config().
class LoopConfigLoader {
 public:
  explicit LoopConfigLoader(const BlobSource& source) : source_(source), reader_(source) {}

  LoopConfigResult run() {
    constexpr const char* file = "loop.json";
    const std::int64_t bytes = source_.size(file);
    if (bytes < 0) return refuse("there is no file loop.json; write the folder with `palpate resolve`");
    const JsonLimits limits;
    if (static_cast<std::uint64_t>(bytes) > limits.text)
      return refuse("loop.json is longer than " + std::to_string(limits.text) + " bytes");
    std::string text(static_cast<std::size_t>(bytes), '\0');
    if (!source_.read(file, text.data(), text.size())) return refuse("loop.json cannot be read");
    const JsonDocument document = parse_json(text, limits);
    if (!document.error.empty()) return refuse("loop.json, " + document.error);
    const Section root = reader_.root(document.value);
    read_format(root);
    if (reader_.ok()) check_text(text);
    config_.title = root.text("title");
    read_mechanism(root.section("mechanism"));
    if (reader_.ok()) read_servo(root.section("servo"));
    if (reader_.ok()) read_plant(root.section("plant"));
    if (reader_.ok()) read_run(root.section("run"));
    if (reader_.ok()) read_controller(root.section("controller"));
    if (reader_.ok() && root.has("guard")) read_guard(root.section("guard"));
    if (reader_.ok()) config_.object_ = detail::read_object(reader_, root.section("object"));
    if (!reader_.ok()) return refuse("loop.json: " + reader_.error() + "; write the folder again with `palpate resolve`");
    return {std::move(config_), ""};
  }

 private:
  using Section = ConfigReader::Section;

  static LoopConfigResult refuse(std::string problem) { return {std::nullopt, std::move(problem)}; }

  void read_format(const Section& root) {
    if (root.text("format") != "palpate loop") return root.fail("format", "must be \"palpate loop\"");
    const std::int64_t version = root.integer("version", 0, 1'000'000);
    if (version != LoopConfig::version)
      root.fail("version", "is " + std::to_string(version) + "; this palpate reads version " + std::to_string(LoopConfig::version));
  }

  /// Require that the text ends with its checksum.
  void check_text(std::string_view text) {
    const std::size_t length = checksum_member("").size(), end = text.size() - std::min(length, text.size());
    const std::string expected = checksum_member(text.substr(0, end));
    if (text.substr(end) != expected) reader_.fail("it is damaged or edited: it must end with " + expected.substr(0, length - 3) + " }");
  }

  void read_mechanism(const Section& from) {
    config_.mechanism = from.text("name");
    const Section given = from.section("parameters");
    mechanism::Registry::for_each([&]<class M>() {
      if (config_.mechanism != M::name) return;
      config_.dof = M::dof;
      for (const std::string& key : given.keys())
        if (std::none_of(M::parameters.begin(), M::parameters.end(), [&](const auto& field) { return key == field.key; }))
          given.fail(key.c_str(), "is no parameter of this mechanism");
      for (const auto& field : M::parameters)
        if (field.required || given.has(field.key)) read_parameter(given, field);
    });
    if (reader_.ok() && config_.dof == 0) from.fail("name", "is \"" + config_.mechanism + "\", which this version does not know");
  }

  template <class Field>
  void read_parameter(const Section& from, const Field& field) {
    std::vector<double> values = from.numbers(field.key, static_cast<std::size_t>(field.size));
    for (const double value : values) {
      if (field.range == mechanism::ParameterRange::positive && !(value > 0.0)) from.fail(field.key, "must be positive");
      if (field.range == mechanism::ParameterRange::nonnegative && !(value >= 0.0)) from.fail(field.key, "must not be negative");
    }
    config_.parameters_.emplace_back(field.key, std::move(values));
  }

  std::vector<double> joints(const Section& from, const char* key, bool infinite = false) {
    return from.numbers(key, static_cast<std::size_t>(config_.dof), infinite);
  }
  std::vector<double> nonnegative_joints(const Section& from, const char* key, bool infinite = false) {
    std::vector<double> out = joints(from, key, infinite);
    for (const double value : out)
      if (!(value >= 0.0)) from.fail(key, "must not be negative");
    return out;
  }

  void read_servo(const Section& from) {
    config_.period_ = from.number("period", 1e-9, 1e3);
    config_.delay_ = static_cast<int>(from.integer("delay", 0, 64));
    config_.start_ = joints(from, "start");
    config_.gravity_compensation_ = from.vector("gravity_compensation");
    config_.frozen_kinematics_ = from.flag("frozen_kinematics");
    config_.encoder_step_ = nonnegative_joints(from, "encoder_step");
    const Section limits = from.section("limits");
    config_.peak_force_ = limits.nonnegative_or_infinite("peak_force");
    config_.continuous_force_ = limits.nonnegative_or_infinite("continuous_force");
    config_.thermal_time_ = limits.positive("thermal_time");
    config_.peak_torque_ = nonnegative_joints(limits, "peak_torque", true);
  }

  void read_plant(const Section& from) {
    const std::size_t kind = from.choice("kind", {"nonlinear", "sampled", "fixed", "flexible"});
    config_.linear_ = kind == 1;
    config_.fixed_ = kind == 2;
    config_.start_speed_ = joints(from, "start_speed");
    config_.substeps_ = static_cast<int>(from.integer("substeps", 1, 10'000));
    config_.jitter_ = from.number("jitter", 0.0, config_.period_);
    if (config_.jitter_ >= config_.period_) from.fail("jitter", "must be less than the period");
    config_.seed_ = static_cast<std::uint64_t>(from.integer("seed", 0, std::int64_t{1} << 53));
    config_.speed_limit_ = from.positive("speed_limit");
    const Section friction = from.section("friction");
    config_.viscous_ = nonnegative_joints(friction, "viscous");
    config_.coulomb_ = nonnegative_joints(friction, "coulomb");
    config_.breakaway_ = nonnegative_joints(friction, "breakaway");
    config_.stribeck_speed_ = nonnegative_joints(friction, "stribeck_speed");
    const Section arm = from.section("human_arm");
    config_.human_arm_.mass = arm.number("mass", 0.0, 1e12);
    config_.human_arm_.damping = arm.number("damping", 0.0, 1e12);
    config_.human_arm_.stiffness = arm.number("stiffness", 0.0, 1e12);
    config_.human_arm_.tissue = arm.flag("tissue");
    config_.human_arm_.tissue_stiffness = arm.number("tissue_stiffness", 0.0, 1e12);
    config_.human_arm_.tissue_damping = arm.number("tissue_damping", 0.0, 1e12);
    config_.human_arm_.rest = arm.vector("rest");
    config_.working_torque_.assign(static_cast<std::size_t>(config_.dof), 0.0);
    if (kind == 3) read_flexible(from.section("flexible"));
    if (!config_.linear_) return;
    const Section model = from.section("model");
    const std::int64_t order = model.integer("order", 0, 1000);
    config_.plant_a_ = model.matrix("a", order, order);
    config_.plant_b_ = model.matrix("b", order, config_.dof);
    config_.plant_c_ = model.matrix("c", config_.dof, order);
    config_.working_torque_ = joints(model, "working_torque");
  }

  void read_flexible(const Section& from) {
    const mechanism::FlexibleMode mode{from.number("frequency"), from.number("tip_share"), from.number("damping_ratio")};
    if (const char* fault = mode.fault(config_.period_); fault != nullptr && reader_.ok())
      reader_.fail(std::string("plant.flexible: ") + fault);
    config_.flexible_ = mode;
  }

  void read_run(const Section& from) {
    config_.ticks = static_cast<int>(from.integer("ticks", 0, LoopConfig::max_ticks));
    config_.record_every_ = static_cast<int>(from.integer("record_every", 1, 10'000));
    config_.reference = read_signal(from, "reference");
    config_.operator_force = read_signal(from, "operator_force");
  }

  /// Read one force per sample; null stands for no force.
  std::vector<double> read_signal(const Section& from, const char* key) {
    if (from.has(key)) return from.blob<double>(key, config_.ticks + 1, 3);
    return std::vector<double>(reader_.ok() ? 3 * (static_cast<std::size_t>(config_.ticks) + 1) : 0, 0.0);
  }

  void read_controller(const Section& from) {
    const std::size_t kind = from.choice("kind", {"state_space", "normalized_state_space", "workspace", "admittance"});
    if (kind == 2) return read_workspace(from);
    if (kind == 3) return read_admittance(from);
    const bool normalized = kind == 1;
    const Vector3<> design_stiffness = normalized ? from.vector("design_stiffness") : Vector3<>(Vector3<>::Ones());
    if (!(design_stiffness.minCoeff() > 0.0)) from.fail("design_stiffness", "must be positive");
    const std::int64_t order = from.integer("order", 0, 1000);
    const Eigen::MatrixXd a = from.matrix("a", order, order), b = from.matrix("b", order, 6), c = from.matrix("c", 3, order),
                          d = from.matrix("d", 3, 6), antiwindup = from.matrix("antiwindup", order, 3);
    if (!reader_.ok()) return;
    control::StateSpace law(a, b, c, d, antiwindup);
    if (normalized) law.normalize(design_stiffness);
    config_.controller_ = std::move(law);
  }

  void read_workspace(const Section& from) {
    control::WorkspaceParameters p = read_feedback(from);
    p.reference = from.positive("reference");
    p.reference_damping = from.positive("reference_damping");
    p.share = from.positive("share");
    p.stiffness = from.vector("stiffness");
    p.normal_only = from.has("normal_only") && from.flag("normal_only");
    if (from.has("operator_mass")) p.operator_mass = from.number("operator_mass");
    if (const char* fault = p.fault(); fault != nullptr && reader_.ok()) from.fail("kind", fault);
    config_.workspace_ = p;
  }

  void read_admittance(const Section& from) {
    const control::WorkspaceParameters p = read_feedback(from);
    const control::VirtualTool tool{from.number("tool_mass"), from.number("tool_damping")};
    for (const char* fault : {p.fault(), tool.fault()})
      if (fault != nullptr && reader_.ok()) from.fail("kind", fault);
    if (reader_.ok() && (config_.fixed_ || config_.linear_))
      from.fail("kind", "is \"admittance\", whose force sensor needs a nonlinear or a flexible plant");
    config_.workspace_ = p;
    config_.tool_ = tool;
  }

  /// Read the feedback of a controller that positions the tip.
  control::WorkspaceParameters read_feedback(const Section& from) {
    control::WorkspaceParameters p;
    if (config_.dof > 3) from.fail("kind", "needs a mechanism with at most three joints");
    p.bandwidth = from.positive("bandwidth");
    p.damping = from.positive("damping");
    p.observer = from.positive("observer");
    p.disturbance = from.positive("disturbance");
    config_.known_friction_ = nonnegative_joints(from, "friction");
    return p;
  }

  void read_guard(const Section& from) {
    if (config_.tool_) return from.fail("kind", "is a guard, which an admittance display does not have");
    const std::size_t kind = from.choice("kind", {"energy_bound", "passivity_controller", "half_sample", "sample_estimate_hold"});
    const char* fault = nullptr;
    if (kind == 0) {
      config_.bound_damping_ = nonnegative_joints(from, "damping");
      config_.bound_coulomb_ = nonnegative_joints(from, "coulomb");
      config_.lateness_ = from.number("lateness", 0.0, config_.period_);
      for (const double damping : config_.bound_damping_)
        if (!(damping > 0.0)) from.fail("damping", "must be positive at each joint");
    } else if (kind == 1) {
      config_.passivity_controller_ = guard::PassivityControllerParameters{from.positive("cap")};
      fault = config_.passivity_controller_->fault();
    } else if (kind == 3) {
      config_.sample_estimate_hold_ = guard::SampleEstimateHoldParameters{from.number("correction")};
      fault = config_.sample_estimate_hold_->fault();
    } else {
      constexpr guard::VelocityEstimate estimates[] = {guard::VelocityEstimate::backward, guard::VelocityEstimate::adaptive_window,
                                                       guard::VelocityEstimate::observer};
      const std::size_t velocity = from.choice("velocity", {"backward", "adaptive_window", "observer"});
      config_.half_sample_ = guard::HalfSampleParameters{estimates[velocity], from.number("horizon"), from.positive("observer"),
                                                         from.has("deadbeat") && from.flag("deadbeat")};
      fault = config_.half_sample_->fault();
    }
    if (fault != nullptr && reader_.ok()) from.fail("kind", fault);
  }

  const BlobSource& source_;
  ConfigReader reader_;
  LoopConfig config_;
};

/// Load a config from a source of files, for example from memory where there is no file system.
[[nodiscard]] inline LoopConfigResult load_loop_config(const BlobSource& source) {
  return LoopConfigLoader(source).run();
}

/// Load the config in `folder`. Allocates and reads files; throws nothing.
[[nodiscard]] inline LoopConfigResult load_loop_config(const std::string& folder) {
  LoopConfigResult out = load_loop_config(FolderSource(folder));
  if (!out) out.error = folder + ": " + out.error;
  return out;
}

}  // namespace palpate::servo
