// Limits TBB's loops to one thread for thread sanitizer: TBB is not built with it, which then misses how
// TBB's threads wait for one another and reports whatever they hand over, with stacks that no suppression can
// tell from others. With one thread for TBB's loops there is nothing to hand over; the pipeline's own threads
// are checked as they are.
#include <tbb/global_control.h>

namespace {
const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
}
