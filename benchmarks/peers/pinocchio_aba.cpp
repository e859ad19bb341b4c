// Times Pinocchio's articulated-body algorithm on a chain of discs and threads.
//
// argv: model, joints, call, then driver.h's. The model is text: number of segments and gravity
// (3), then for each segment bend A (9, by rows), exit point (3), length, twist B (9), mass,
// centre of mass (3), inertia about it (9), all in the discs' frames. `joints` says how a
// segment's five angles are modelled, below. `call` is aba-local, aba-world (the library's two
// conventions) or derivatives. A state is q, v, tau in that modelling's coordinates; a result is
// the acceleration, followed for derivatives by its Jacobians by q, v and tau, by columns.
//
// With -DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION the algorithm comes from the shared library (do
// not add -march then: Eigen's alignment, hence the layout of the data, would differ from the
// library's); without it, the headers' templates are compiled here and nothing is linked.
// As the library's CMake file asks: there are more joint types than Boost's lists hold by default.
#define BOOST_MPL_CFG_NO_PREPROCESSED_HEADERS
#define BOOST_MPL_LIMIT_LIST_SIZE 30
#define BOOST_MPL_LIMIT_VECTOR_SIZE 30
#define BOOST_FUSION_INVOKE_MAX_ARITY 12
#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/multibody.hpp>
#include <pinocchio/multibody/joint.hpp>

#include <fstream>
#include <memory>
#include <string>

#include "../driver.h"

namespace pin = pinocchio;
using Eigen::Matrix3d, Eigen::Vector3d, Eigen::VectorXd, pin::SE3;
using Vectors = Eigen::Map<const VectorXd>;
using Argument = Eigen::Ref<const VectorXd>;  // the type the library is instantiated for

static pin::Model model;
static std::unique_ptr<pin::Data> data;
static const double *all;
static size_t stride;
static bool derivatives;
static pin::Convention convention = pin::Convention::LOCAL;
static VectorXd output;

// Half a turn about x + z: carries Pinocchio's z, y, x sequence of angles to x, -y, z.
static const Matrix3d relabel = (Matrix3d() << 0, 0, 1, 0, -1, 0, 1, 0, 0).finished();

static Matrix3d read_matrix(std::istream &in) {
    Matrix3d m;
    for (int i = 0; i < 9; i++) in >> m(i / 3, i % 3);
    return m;
}

static Vector3d read_vector(std::istream &in) {
    Vector3d v;
    in >> v[0] >> v[1] >> v[2];
    return v;
}

// Appends joints to the chain's tip; bodies between the joints of a segment have no mass.
struct Chain {
    pin::JointIndex tip = 0;
    void add(const pin::JointModel &joint, const SE3 &placement) {
        tip = model.addJoint(tip, joint, placement, std::to_string(model.njoints));
    }
};

static void add_segment(Chain &chain, const std::string &joints, const SE3 &base, const SE3 &end) {
    const SE3 here = SE3::Identity(), turned(end.rotation() * relabel, end.translation());
    const pin::JointModelUniversal universal(Vector3d::UnitX(), Vector3d::UnitY());
    if (joints == "revolute") {
        chain.add(pin::JointModelRX(), base);
        chain.add(pin::JointModelRY(), here);
        chain.add(pin::JointModelRX(), end);
        chain.add(pin::JointModelRY(), here);
        chain.add(pin::JointModelRZ(), here);
    } else if (joints == "composite_revolute") {
        pin::JointModelComposite all_five{pin::JointModelRX()};
        all_five.addJoint(pin::JointModelRY());
        all_five.addJoint(pin::JointModelRX(), end);
        all_five.addJoint(pin::JointModelRY());
        all_five.addJoint(pin::JointModelRZ());
        chain.add(all_five, base);
    } else if (joints == "composite_zyx") {
        pin::JointModelComposite both{universal};
        both.addJoint(pin::JointModelSphericalZYX(), turned);
        chain.add(both, base);
    } else if (joints == "composite_quaternion") {
        pin::JointModelComposite both{universal};
        both.addJoint(pin::JointModelSpherical(), end);
        chain.add(both, base);
    } else if (joints == "universal_zyx") {
        chain.add(universal, base);
        chain.add(pin::JointModelSphericalZYX(), turned);
    } else if (joints == "universal_quaternion") {
        chain.add(universal, base);
        chain.add(pin::JointModelSpherical(), end);
    } else if (joints == "hinges_zyx") {
        chain.add(pin::JointModelRX(), base);
        chain.add(pin::JointModelRY(), here);
        chain.add(pin::JointModelSphericalZYX(), turned);
    } else if (joints == "hinges_quaternion") {
        chain.add(pin::JointModelRX(), base);
        chain.add(pin::JointModelRY(), here);
        chain.add(pin::JointModelSpherical(), end);
    } else {
        fail("unknown joints", joints.c_str());
    }
}

static void build(const char *path, const std::string &joints) {
    std::ifstream in(path);
    int n_segments = 0;
    in >> n_segments;
    model.gravity.linear() = read_vector(in);
    const bool zyx = joints.size() > 3 && joints.substr(joints.size() - 3) == "zyx";
    const SE3 disc(zyx ? relabel : Matrix3d::Identity(), Vector3d::Zero());  // in the joint's frame
    Chain chain;
    for (int i = 0; i < n_segments; i++) {
        const Matrix3d bend = read_matrix(in);
        const Vector3d exit_point = read_vector(in);
        double length = 0, mass = 0;
        in >> length;
        const Matrix3d twist = read_matrix(in);
        in >> mass;
        const Vector3d centre = read_vector(in);
        const pin::Inertia inertia(mass, centre, read_matrix(in));
        SE3 base(bend, exit_point);
        if (chain.tip > 0) base = disc * base;
        add_segment(chain, joints, base, SE3(twist, length * Vector3d::UnitZ()));
        model.appendBodyToJoint(chain.tip, inertia, disc);
    }
    if (!in) fail("cannot read the model", path);
    data = std::make_unique<pin::Data>(model);
}

static void load(int, size_t width, const double *states) {
    if (width != size_t(model.nq + 2 * model.nv)) fail("states do not fit the model", "pinocchio");
    all = states;
    stride = width;
}

static void evaluate(int state) {
    const double *now = all + size_t(state) * stride;
    const Argument q = Vectors(now, model.nq), v = Vectors(now + model.nq, model.nv);
    const Argument tau = Vectors(now + model.nq + model.nv, model.nv);
    if (derivatives)
        pin::computeABADerivatives(model, *data, q, v, tau);
    else
        pin::aba(model, *data, q, v, tau, convention);
}

static const double *result() {
    const long n = model.nv;
    if (!derivatives) return data->ddq.data();
    Eigen::Map<Eigen::MatrixXd> columns(output.data(), n, 1 + 3 * n);
    columns << data->ddq, data->ddq_dq, data->ddq_dv, data->Minv;
    return output.data();
}

static size_t result_size() { return size_t(derivatives ? output.size() : model.nv); }

int main(int argc, char **argv) {
    if (argc != 8) fail("usage", "pinocchio_aba MODEL JOINTS CALL STATES N_STATES RESULTS SECONDS");
    const std::string call = argv[3];
    derivatives = call == "derivatives";
    if (call == "aba-world") convention = pin::Convention::WORLD;
    build(argv[1], argv[2]);
    output.resize(model.nv * (1 + 3 * model.nv));
    return run(argv + 4);
}
