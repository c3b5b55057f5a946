/* One control step, in C99 with math.h, without allocation. */

#include <math.h>

/* A layer: the sums over `inputs` numbers for each of `rows`; weights lie input by input, for all rows. An LSTM layer
   has `units`: its rows are their input, forget, candidate and output gates, its last inputs their hidden states. */
struct snake_layer {
    int units, inputs, rows;
    const float *weight, *bias;
};

static const struct snake_layer snake_layers[] = {SNAKE_LAYERS};

/* What the policy remembers, all LSTM layers side by side. It is zero at the beginning of a run. */
struct snake_memory {
    float hidden[SNAKE_UNITS], cell[SNAKE_UNITS];
};

/* Scale values in the units of the list above to an observation. */
static inline void snake_observe(const float values[SNAKE_INPUTS], float observation[SNAKE_INPUTS])
{
    for (int i = 0; i < SNAKE_INPUTS; i++) observation[i] = snake_scale[i] * values[i] + snake_offset[i];
}

static inline float snake_sigmoid(float x)
{
    return 0.5f + 0.5f * tanhf(0.5f * x);
}

/* Inputs are summed in blocks of 16, since long sums of 32-bit numbers gather rounding errors. */
static inline void snake_sums(const struct snake_layer *layer, const float *x, float *sum)
{
    float part[SNAKE_WIDEST];
    const float *weight = layer->weight;
    const int rows = layer->rows;
    for (int r = 0; r < rows; r++) sum[r] = layer->bias[r];
    for (int i = 0; i < layer->inputs;) {
        for (int r = 0; r < rows; r++) part[r] = 0.0f;
        for (int end = i + 16; i < end && i < layer->inputs; i++, weight += rows)
            for (int r = 0; r < rows; r++) part[r] += weight[r] * x[i];
        for (int r = 0; r < rows; r++) sum[r] += part[r];
    }
}

static inline void snake_lstm(int units, const float *gate, float *hidden, float *cell)
{
    for (int i = 0; i < units; i++) {
        cell[i] = snake_sigmoid(gate[units + i]) * cell[i] + snake_sigmoid(gate[i]) * tanhf(gate[2 * units + i]);
        hidden[i] = snake_sigmoid(gate[3 * units + i]) * tanhf(cell[i]);
    }
}

/* Target angles [rad] after an observation. The memory is that of the last step, and becomes that of this one. */
static inline void snake_step(const float observation[SNAKE_INPUTS], struct snake_memory *memory,
                              float action[SNAKE_JOINTS])
{
    float x[SNAKE_WIDEST], sum[SNAKE_WIDEST], *hidden = memory->hidden, *cell = memory->cell;
    const struct snake_layer *layer = snake_layers, *last = snake_layers + sizeof snake_layers / sizeof *layer - 1;
    for (int i = 0; i < SNAKE_INPUTS; i++) x[i] = observation[i];
    for (; layer < last; layer++) {
        const int units = layer->units;
        for (int i = 0; i < units; i++) x[layer->inputs - units + i] = hidden[i];
        snake_sums(layer, x, sum);
        if (units) {
            snake_lstm(units, sum, hidden, cell);
            for (int i = 0; i < units; i++) x[i] = hidden[i];
            hidden += units, cell += units;
        } else {
            for (int r = 0; r < layer->rows; r++) x[r] = sum[r] > 0.0f ? sum[r] : expm1f(sum[r]);
        }
    }
    snake_sums(last, x, sum);
    for (int j = 0; j < SNAKE_JOINTS; j++) {
        const float a = sum[j];
        action[j] = a < -1.0f ? -1.0f : a > 1.0f ? 1.0f : a == a ? a : 0.0f; /* never NaN to a servo */
    }
}

#endif
