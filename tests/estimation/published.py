"""Estimation problems with published data, estimates and standard errors.

Sources: NIST Statistical Reference Datasets, nonlinear regression (certified values); the reference output of the
examples of R's package `stats`, whose data sets are those of Bates & Watts 1988 and of J. C. Pinheiro and D. M.
Bates, Mixed-Effects Models in S and S-PLUS, 2000. Where the published model is the solution of a differential
equation, the equation is what is stated here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal


@dataclass(frozen=True)
class Estimate:
    """A parameter, its value and its standard error, with the digits that have been published."""

    name: str
    value: str
    error: str

    @staticmethod
    def unit(text: str) -> float:
        """One unit of the last digit of a published number."""
        exponent = Decimal(text).as_tuple().exponent
        assert isinstance(exponent, int)
        return float(Decimal(10) ** exponent)


@dataclass(frozen=True)
class Published:
    """A spec, what it has to come to, and the residual standard deviation with its degrees of freedom."""

    spec: str
    estimates: Sequence[Estimate]
    deviation: str
    freedom: int
    differential: bool = True


def _rows(first: Sequence[float], second: Sequence[float]) -> str:
    return ", ".join(f"({a!r}, {b!r})" for a, b in zip(first, second, strict=True))


MISRA_X = [77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0]
MISRA_Y = [10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78]
THURBER_X = [
    *(-3.067, -2.981, -2.921, -2.912, -2.840, -2.797, -2.702, -2.699, -2.633, -2.481, -2.363, -2.322, -1.501),
    *(-1.460, -1.274, -1.212, -1.100, -1.046, -0.915, -0.714, -0.566, -0.545, -0.400, -0.309, -0.109, -0.103),
    *(0.010, 0.119, 0.377, 0.790, 0.963, 1.006, 1.115, 1.572, 1.841, 2.047, 2.200),
]
THURBER_Y = [
    *(
        80.574,
        84.248,
        87.264,
        87.195,
        89.076,
        89.608,
        89.868,
        90.101,
        92.405,
        95.854,
        100.696,
        101.060,
        401.672,
    ),
    *(390.724, 567.534, 635.316, 733.054, 759.087, 894.206, 990.785, 1090.109, 1080.914, 1122.643, 1178.351),
    *(1260.531, 1273.514, 1288.339, 1327.543, 1353.863, 1414.509, 1425.208, 1421.384, 1442.962, 1464.350),
    *(1468.705, 1447.894, 1457.628),
]
MGH09_X = [4.0, 2.0, 1.0, 0.5, 0.25, 0.167, 0.125, 0.1, 0.0833, 0.0714, 0.0625]
MGH09_Y = [0.1957, 0.1947, 0.1735, 0.16, 0.0844, 0.0627, 0.0456, 0.0342, 0.0323, 0.0235, 0.0246]
PUROMYCIN_X = [0.02, 0.02, 0.06, 0.06, 0.11, 0.11, 0.22, 0.22, 0.56, 0.56, 1.10, 1.10]
PUROMYCIN_Y = [76, 47, 97, 107, 123, 139, 159, 152, 191, 201, 207, 200]
MGH17_Y = [
    *(
        0.844,
        0.908,
        0.932,
        0.936,
        0.925,
        0.908,
        0.881,
        0.850,
        0.818,
        0.784,
        0.751,
        0.718,
        0.685,
        0.658,
        0.628,
    ),
    *(
        0.603,
        0.580,
        0.558,
        0.538,
        0.522,
        0.506,
        0.490,
        0.478,
        0.467,
        0.457,
        0.448,
        0.438,
        0.431,
        0.424,
        0.420,
    ),
    *(0.414, 0.411, 0.406),
]
RAT42_T = [9.0, 14.0, 21.0, 28.0, 42.0, 57.0, 63.0, 70.0, 79.0]
RAT42_Y = [8.93, 10.80, 18.59, 22.33, 39.35, 56.11, 61.73, 64.62, 67.08]
THEOPH_T = [0, 0.25, 0.57, 1.12, 2.02, 3.82, 5.1, 7.03, 9.05, 12.12, 24.37]
THEOPH_Y = [0.74, 2.84, 6.57, 10.5, 9.66, 8.58, 8.36, 7.47, 6.89, 5.94, 3.28]
INDOMETH_T = [0.25, 0.5, 0.75, 1, 1.25, 2, 3, 4, 5, 6, 8]
INDOMETH_Y = [1.5, 0.94, 0.78, 0.48, 0.37, 0.19, 0.12, 0.11, 0.08, 0.07, 0.05]
CHICK_T = [0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 21]
CHICK_Y = [42, 51, 59, 64, 76, 93, 106, 125, 149, 171, 199, 205]

PROBLEMS: dict[str, Published] = {
    # ------------------------------------------------------------------------------------------- without motion
    "Misra1a": Published(
        f"""parameters: b1, b2;
        data: misra = (y, x): {_rows(MISRA_Y, MISRA_X)};
        objective: [misra]: (b1*(1 - exp(-b2*misra.x)) - misra.y)^2;
        guess: b1 = 500; b2 = 0.0001;""",
        [
            Estimate("b1", "238.94212918", "2.7070075241"),
            Estimate("b2", "5.5015643181E-04", "7.2668688436E-06"),
        ],
        "1.0187876330E-01",
        12,
        differential=False,
    ),
    "Thurber": Published(
        f"""parameters: for k in 1..7: b{{k}};
        data: thurber = (y, x): {_rows(THURBER_Y, THURBER_X)};
        objective:
          [thurber]: ((b1 + sum(k in 2..4: b{{k}}*thurber.x^{{k-1}}))
            / (1 + sum(k in 5..7: b{{k}}*thurber.x^{{k-4}})) - thurber.y)^2;
        guess: b1 = 1300; b2 = 1500; b3 = 500; b4 = 75; b5 = 1; b6 = 0.4; b7 = 0.05;""",
        [
            Estimate("b1", "1288.1396800", "4.6647963344"),
            Estimate("b2", "1491.0792535", "39.571156086"),
            Estimate("b3", "583.23836877", "28.698696102"),
            Estimate("b4", "75.416644291", "5.5675370270"),
            Estimate("b5", "0.96629502864", "3.1333340687E-02"),
            Estimate("b6", "0.39797285797", "1.4984928198E-02"),
            Estimate("b7", "4.9727297349E-02", "6.5842344623E-03"),
        ],
        "13.714600784",
        30,
        differential=False,
    ),
    "MGH09": Published(
        f"""parameters: for k in 1..4: b{{k}};
        data: d = (y, x): {_rows(MGH09_Y, MGH09_X)};
        objective: [d]: (b1*(d.x^2 + d.x*b2)/(d.x^2 + d.x*b3 + b4) - d.y)^2;
        guess: b1 = 0.25; b2 = 0.39; b3 = 0.415; b4 = 0.39;""",
        [
            Estimate("b1", "1.9280693458E-01", "1.1435312227E-02"),
            Estimate("b2", "1.9128232873E-01", "1.9633220911E-01"),
            Estimate("b3", "1.2305650693E-01", "8.0842031232E-02"),
            Estimate("b4", "1.3606233068E-01", "9.0025542308E-02"),
        ],
        "6.6279236551E-03",
        7,
        differential=False,
    ),
    "Puromycin": Published(
        f"""parameters: Vm, K;
        data: treated = (conc, rate): {_rows(PUROMYCIN_X, PUROMYCIN_Y)};
        objective: [treated]: (Vm*treated.conc/(K + treated.conc) - treated.rate)^2;
        guess: Vm = 200; K = 0.05;""",
        [Estimate("Vm", "212.7", "6.947"), Estimate("K", "0.06412", "0.008281")],
        "10.93",
        10,
        differential=False,
    ),
    # ------------------------------------------------------------------------------------ differential equations
    "BoxBOD": Published(
        """constants: n = 400, T = 10, h = T/n;
        variables: y;
        parameters: b1, b2;
        data: bod = (time, y): (1, 109), (2, 149), (3, 149), (5, 191), (7, 213), (10, 224);
        constraints: [0, n]: y' = b2*(b1 - y); [0]: y;
        objective: [bod]: (y - bod.y)^2;
        guess: b1 = 100; b2 = 0.75; y = 100*(1 - exp(-0.75*t));
        method: hermite-simpson;""",
        [
            Estimate("b1", "213.80940889", "12.354515176"),
            Estimate("b2", "5.4723748542E-01", "1.0455993237E-01"),
        ],
        "17.088072423",
        4,
    ),
    "Rat42": Published(
        f"""constants: n = 632, T = 79, h = T/n;
        variables: y;
        parameters: b1, b2, b3;
        data: rat = (time, y): {_rows(RAT42_T, RAT42_Y)};
        constraints: [0, n]: y' = b3*y*(1 - y/b1); [0]: y = b1/(1 + exp(b2));
        objective: [rat]: (y - rat.y)^2;
        guess: b1 = 75; b2 = 2.5; b3 = 0.07; y = 75/(1 + exp(2.5 - 0.07*t));
        method: hermite-simpson;""",
        [
            Estimate("b1", "72.462237576", "1.7340283401"),
            Estimate("b2", "2.6180768402", "8.8295217536E-02"),
            Estimate("b3", "6.7359200066E-02", "3.4465663377E-03"),
        ],
        "1.1587725499",
        6,
    ),
    "MGH17": Published(
        f"""constants: n = 640, T = 320, h = T/n;
        variables: u, v;
        parameters: for k in 1..5: b{{k}};
        data: d = (time, y): {_rows([10.0 * k for k in range(33)], MGH17_Y)};
        constraints: [0, n]: u' = -b4*u; v' = -b5*v; [0]: u = b2; v = b3;
        objective: [d]: (b1 + u + v - d.y)^2;
        guess: b1 = 0.5; b2 = 1.5; b3 = -1; b4 = 0.01; b5 = 0.02; u = 1.5*exp(-0.01*t); v = -exp(-0.02*t);
        method: hermite-simpson;""",
        [
            Estimate("b1", "3.7541005211E-01", "2.0723153551E-03"),
            Estimate("b2", "1.9358469127", "2.2031669222E-01"),
            Estimate("b3", "-1.4646871366", "2.2175707739E-01"),
            Estimate("b4", "1.2867534640E-02", "4.4861358114E-04"),
            Estimate("b5", "2.2122699662E-02", "8.9471996575E-04"),
        ],
        "1.3970497866E-03",
        28,
    ),
    "Theoph, subject 1": Published(
        f"""constants: n = 400, T = 24.37, dose = 4.02;
        definitions: h = 2*T*(i + 0.5)/n^2;
        variables: gut, conc;
        parameters: lKe, lKa, lCl;
        data: theoph = (time, conc): {_rows(THEOPH_T, THEOPH_Y)};
        constraints:
          [0, n]: gut' = -exp(lKa)*gut; conc' = exp(lKa)*exp(lKe - lCl)*gut - exp(lKe)*conc;
          [0]: gut = dose; conc;
        objective: [theoph]: (conc - theoph.conc)^2;
        guess: lKe = -2.5; lKa = 0.5; lCl = -3; gut = 4.02*exp(-1.6*t); conc = 8;
        method: hermite-simpson;""",
        [
            Estimate("lKe", "-2.9196", "0.1709"),
            Estimate("lKa", "0.5752", "0.1728"),
            Estimate("lCl", "-3.9159", "0.1273"),
        ],
        "0.732",
        8,
    ),
    "Indometh, subject 1": Published(
        f"""constants: n = 160, T = 8, h = T/n;
        variables: u, v;
        parameters: A1, lrc1, A2, lrc2;
        data: indo = (time, conc): {_rows(INDOMETH_T, INDOMETH_Y)};
        constraints: [0, n]: u' = -exp(lrc1)*u; v' = -exp(lrc2)*v; [0]: u = A1; v = A2;
        objective: [indo]: (u + v - indo.conc)^2;
        guess: A1 = 2; lrc1 = 0.5; A2 = 0.2; lrc2 = -1.7; u = 2*exp(-1.6*t); v = 0.2*exp(-0.18*t);
        method: hermite-simpson;""",
        [
            Estimate("A1", "2.0293", "0.1099"),
            Estimate("lrc1", "0.5794", "0.1247"),
            Estimate("A2", "0.1915", "0.1106"),
            Estimate("lrc2", "-1.7878", "0.7871"),
        ],
        "0.04103",
        7,
    ),
    "Loblolly, seed 329": Published(
        f"""constants: n = 100, T = 25, h = T/n;
        variables: y;
        parameters: Asym, R0, lrc;
        data: pine = (time, height): {_rows([3, 5, 10, 15, 20, 25], [3.93, 9.34, 26.08, 37.79, 48.31, 56.43])};
        constraints: [0, n]: y' = exp(lrc)*(Asym - y); [0]: y = R0;
        objective: [pine]: (y - pine.height)^2;
        guess: Asym = 100; R0 = -8; lrc = -3; y = 2*t;
        method: hermite-simpson;""",
        [
            Estimate("Asym", "94.1282", "8.4030"),
            Estimate("R0", "-8.2508", "1.2261"),
            Estimate("lrc", "-3.2176", "0.1386"),
        ],
        "0.7493",
        3,
    ),
    "ChickWeight, chick 1": Published(
        f"""constants: n = 84, T = 21, h = T/n;
        variables: p;
        parameters: A, B, xmid, scal;
        data: chick = (time, weight): {_rows(CHICK_T, CHICK_Y)};
        constraints: [0, n]: p' = p*(1 - p)/scal; [0]: p = 1/(1 + exp(xmid/scal));
        objective: [chick]: (A + (B - A)*p - chick.weight)^2;
        guess: A = 30; B = 300; xmid = 18; scal = 6; p = 1/(1 + exp((18 - t)/6));
        method: hermite-simpson;""",
        [
            Estimate("A", "27.453", "6.601"),
            Estimate("B", "348.971", "57.899"),
            Estimate("xmid", "19.391", "2.194"),
            Estimate("scal", "6.673", "1.002"),
        ],
        "2.351",
        8,
    ),
}
