"""Ranges of the multicopter families: lengths over the motor diagonal, degrees (see `MulticopterParameters`)."""

from __future__ import annotations

from typing import Any

COMMON: dict[str, Any] = {
    "arms": 4,
    "nose_angle": (40.0, 50.0),
    "tail_angle": (40.0, 50.0),
    "propeller_fill": (0.72, 0.96),
    "blades": [2, 2, 2, 3],
    "blade_chord": (0.09, 0.15),
    "arm_width": (0.025, 0.05),
    "arm_height": (0.02, 0.05),
    "arm_rise": (-0.02, 0.05),
    "round_arms": [True, False],
    "frame": "radial",
    "hull": ["dome", "box", "stack"],
    "hull_length": (0.28, 0.45),
    "hull_width": (0.22, 0.36),
    "hull_height": (0.1, 0.18),
    "legs": ["skids", "posts", "none"],
    "leg_height": (0.1, 0.25),
    "motor_radius": (0.028, 0.042),
    "motor_height": (0.04, 0.07),
    "hertz": (70.0, 130.0),
    "battery": [0.0, 0.1, 0.16],
    "antennas": (0, 2),
    "gps_mast": [0.0, 0.0, 0.1],
}

MANY_ARMS: dict[str, Any] = COMMON | {
    "propeller_fill": (0.78, 0.96),
    "hull": ["dome", "stack", "stack", "box"],
    "hull_length": (0.24, 0.36),
    "hull_width": (0.22, 0.32),
    "round_arms": [True, True, False],
    "arm_width": (0.02, 0.032),
    "motor_radius": (0.02, 0.03),
    "gimbal": [0.0, 0.1, 0.13],
    "legs": ["skids", "skids", "posts"],
    "leg_height": (0.18, 0.32),
    "gps_mast": [0.0, 0.1, 0.15],
}

FAMILIES: dict[str, dict[str, Any]] = {
    "racing_quad": COMMON
    | {
        "nose_angle": (38.0, 58.0),
        "tail_angle": (38.0, 52.0),
        "blades": [2, 3, 3],
        "blade_chord": (0.12, 0.17),
        "arm_height": (0.015, 0.028),
        "arm_rise": 0.0,
        "round_arms": False,
        "hull": ["stack", "box"],
        "hull_length": (0.4, 0.6),
        "hull_width": (0.13, 0.2),
        "hull_height": (0.08, 0.15),
        "legs": "none",
        "motor_radius": (0.05, 0.065),
        "motor_height": (0.06, 0.09),
        "hertz": (110.0, 150.0),
        "battery": (0.1, 0.18),
        "antennas": (1, 2),
    },
    "camera_quad": COMMON
    | {
        "nose_angle": (32.0, 50.0),
        "hull": "dome",
        "hull_length": (0.42, 0.68),
        "hull_width": (0.2, 0.34),
        "hull_height": (0.14, 0.24),
        "arm_height": (0.035, 0.07),
        "arm_rise": (0.0, 0.07),
        "legs": ["posts", "skids", "motor_posts"],
        "leg_height": (0.12, 0.32),
        "gimbal": (0.08, 0.13),
        "blades": 2,
    },
    "research_quad": COMMON
    | {
        "nose_angle": (38.0, 62.0),
        "hull": ["stack", "dome", "box"],
        "propeller_fill": (0.6, 0.85),
        "hull_length": (0.25, 0.42),
        "legs": ["posts", "motor_posts", "skids"],
        "gimbal": [0.0, 0.09],
        "gps_mast": [0.0, 0.12],
    },
    "hexacopter": MANY_ARMS | {"arms": 6, "nose_angle": [0.0, 30.0]},
    "octocopter": MANY_ARMS | {"arms": 8, "nose_angle": [0.0, 22.5], "arm_width": (0.016, 0.026)},
    "guarded_quad": COMMON
    | {
        "guard": ["ring", "duct", "duct"],
        "propeller_fill": (0.72, 0.86),
        "blades": [2, 3, 3],
        "blade_chord": (0.12, 0.18),
        "hull_width": (0.16, 0.26),
        "arm_rise": 0.0,
        "legs": "none",
        "hull_height": (0.1, 0.2),
    },
    "micro_quad": COMMON
    | {
        "hull": ["dome", "plate", "stack"],
        "hull_length": (0.28, 0.45),
        "hull_width": (0.22, 0.34),
        "hull_height": (0.06, 0.16),
        "arm_width": (0.025, 0.06),
        "motor_radius": (0.035, 0.05),
        "motor_height": (0.1, 0.2),
        "legs": ["none", "motor_posts"],
        "leg_height": (0.08, 0.16),
        "hertz": (120.0, 150.0),
        "propeller_fill": (0.68, 0.92),
        "blade_chord": (0.13, 0.27),
        "gps_mast": 0.0,
    },
    "heavy_lift": MANY_ARMS
    | {
        "arms": [4, 6, 6, 8],
        "nose_angle": 30.0,
        "payload": ["box", "tank", "bottle"],
        "payload_size": (0.18, 0.32),
        "legs": "skids",
        "leg_height": (0.28, 0.42),
        "hull_height": (0.1, 0.16),
        "hertz": (70.0, 90.0),
        "gimbal": 0.0,
    },
    "tricopter": COMMON
    | {"arms": 3, "nose_angle": (50.0, 66.0), "hull": ["stack", "plate", "box"], "gimbal": [0.0, 0.1]},
    "h_frame": COMMON
    | {
        "frame": "h",
        "nose_angle": (42.0, 60.0),
        "hull": ["plate", "stack", "box"],
        "hull_width": (0.14, 0.24),
        "legs": ["skids", "posts"],
        "gimbal": [0.0, 0.1],
    },
    "coaxial_y6": MANY_ARMS | {"arms": 3, "nose_angle": (54.0, 64.0), "coaxial": True},
    "coaxial_x8": MANY_ARMS | {"arms": 4, "nose_angle": (40.0, 50.0), "coaxial": True},
    "dead_cat": COMMON
    | {
        "nose_angle": (62.0, 76.0),
        "tail_angle": (34.0, 44.0),
        "frame": "v",
        "hull": ["dome", "plate", "stack"],
        "hull_length": (0.45, 0.6),
        "hull_width": (0.14, 0.26),
        "legs": ["posts", "none", "motor_posts"],
        "pusher": [False, True],
        "gimbal": (0.08, 0.12),
    },
}

SPLITS: dict[str, tuple[str, ...]] = {
    "train": (
        "camera_quad",
        "racing_quad",
        "hexacopter",
        "micro_quad",
        "research_quad",
        "tricopter",
        "guarded_quad",
        "heavy_lift",
        "coaxial_x8",
    ),
    "val": ("octocopter", "h_frame"),
    "test": ("dead_cat", "coaxial_y6"),
}
"""Which families each split draws from, in the order of the identities."""
