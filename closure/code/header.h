/* == ALWAYS */
/* Posture at home, closed. */
extern const name_real name_home[NAME_Q];

/* Sentence for a code that a function returned. */
const char *name_sentence(int code);

/* Largest of all closure rows at q [m or rad]: how far the loops are from being closed. */
name_real name_residual(const name_real *q);

/* How far the joints are within their limits at q, at most 1; negative beyond [m or rad]. */
name_real name_within_limits(const name_real *q);

/* == DIRECT */
/* Direct position problem: q with given inputs (INPUTS), on the assembly branch of a guess (Q).

   The inputs move on a straight line from those of the guess, in steps that cannot pass a
   singularity unnoticed. A guess of 0 is home. The guess need not be closed to the last digit.
   q may be the guess itself. Returns ARRIVED, or why the way ended; q is then the last good
   posture before. UNTRIED, for numbers that are not finite, leaves q as it was. */
int name_direct(const name_real *inputs, const name_real *guess, name_real *q);

/* Inputs (INPUTS) at q. */
void name_inputs_of(const name_real *q, name_real *inputs);

/* == INVERSE */
/* Inverse position problem: q with the tip at a pose (POSE), on the branch of a guess (Q).

   Components of the pose that are no outputs are not used. The tip's origin moves on a straight
   line, its rotation about a fixed axis. Otherwise as the direct problem; UNTRIED also for a
   quaternion whose norm is not 1 to three digits. */
int name_inverse(const name_real *pose, const name_real *guess, name_real *q);

/* Pose (POSE) of the tip in the world at q. */
void name_tip(const name_real *q, name_real *pose);

/* == MEASURE */
/* First-order kinematics of a closed posture.

   twist_map: rates of the outputs [m/s, rad/s] for rates of the inputs: V = twist_map u. Rotations
   are about the world's axes where all three are outputs, else about the tip's own.
   sigma_direct, sigma_inverse: zero at direct and inverse singularities; distances from them, in
   dimensionless rates of all joints.
   det_direct, det_inverse: of K in the passive columns, and of K with the task Jacobian; 0 where
   there is no such determinant. Only their signs and zeros mean something. */
typedef struct {
    name_real twist_map[NAME_OUTPUTS][NAME_INPUTS];
    name_real sigma_direct, sigma_inverse;
    name_real det_direct, det_inverse;
} name_measures;

/* Measure q. Returns ARRIVED; SINGULAR where the inputs do not determine the tip's motion, with a
   twist map of zeros; OPEN where q does not close; DEGENERATE where K loses more than six ranks;
   UNTRIED where q is not finite. What is not found is 0. */
int name_measure(const name_real *q, name_measures *found);

/* Efforts of the inputs [N for slides, N m for angles] that hold a load at rest, joints without
   friction. wrench: force and moment [N, N m] on the robot at the tip's origin, along the world's
   axes; 0 for none. fall: acceleration of free fall [m/s^2]; 0 for 9.81 against the world's z,
   three zeros for none. Returns as name_measure; SINGULAR where the inputs do not hold the load. */
int name_efforts(const name_real *q, const name_real *wrench, const name_real *fall,
                 name_real *efforts);

