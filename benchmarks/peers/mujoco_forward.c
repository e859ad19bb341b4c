/* Times MuJoCo's forward dynamics on the model of an XML file.
 *
 * argv: model, call (forward | smooth), then driver.h's. `forward` is mj_forward; `smooth` is only
 * what an unconstrained chain needs of it: kinematics, mass matrix, factor, bias, solve. A state
 * is qpos, qvel, qfrc_applied; a result is qacc. */
#include <mujoco/mujoco.h>

#include "../driver.h"

static mjModel *model;
static mjData *data;
static const double *all;
static size_t stride;
static int smooth;

static void load(int n_states, size_t width, const double *states) {
    (void)n_states;
    if (width != (size_t)(model->nq + 2 * model->nv)) fail("states do not fit the model", "mujoco");
    all = states;
    stride = width;
}

static void evaluate(int state) {
    const double *now = all + (size_t)state * stride;
    memcpy(data->qpos, now, (size_t)model->nq * sizeof(double));
    memcpy(data->qvel, now + model->nq, (size_t)model->nv * sizeof(double));
    const double *force = now + model->nq + model->nv;
    if (!smooth) {
        memcpy(data->qfrc_applied, force, (size_t)model->nv * sizeof(double));
        mj_forward(model, data);
        return;
    }
    mj_kinematics(model, data);
    mj_comPos(model, data);
    mj_makeM(model, data);
    mj_factorM(model, data);
    mj_comVel(model, data);
    mj_rne(model, data, 0, data->qfrc_bias);
    for (int i = 0; i < model->nv; i++) data->qfrc_smooth[i] = force[i] - data->qfrc_bias[i];
    mj_solveM(model, data, data->qacc, data->qfrc_smooth, 1);
}

static const double *result(void) { return data->qacc; }

static size_t result_size(void) { return (size_t)model->nv; }

int main(int argc, char **argv) {
    char error[1000] = "";
    if (argc != 7) fail("usage", "mujoco_forward MODEL CALL STATES N_STATES RESULTS SECONDS");
    model = mj_loadXML(argv[1], NULL, error, sizeof error);
    if (!model) fail("cannot load the model", error);
    data = mj_makeData(model);
    smooth = strcmp(argv[2], "smooth") == 0;
    return run(argv + 3);
}
