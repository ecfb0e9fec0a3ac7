// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>

#include <optional>

namespace view_servo
{
/** How much a camera has to move before PlaceWatch judges, and how exact what it compares is. */
struct PlaceWatchLimits
{
  double jump;        ///< change of the view's place from one sight to the next that is no error [m]
  double jump_turn;   ///< the same of its orientation [rad]
  double proof;       ///< way after which what is seen has proved to move as the camera does [m]
  double proof_turn;  ///< turn after which it has [rad]
  double doubt;       ///< way after which it is known not to [m]
  double doubt_turn;  ///< turn after which it is [rad]
};

/**
 * Compares how a camera moves by what is seen of the stored view with how it moves by odometry or by the commands sent.
 * A picture of the view held before the camera, a camera that delivers the same image again and again, and one that is
 * mounted otherwise than is said look like the view, but do not move as it does.
 */
class PlaceWatch
{
public:
  explicit PlaceWatch(const PlaceWatchLimits& limits) : limits_(limits)
  {
  }

  /**
   * The view was seen.
   * @param camera pose of the camera by odometry or by commands, in a frame that stays [m].
   * @param view_in_camera pose of the view's camera in the present one, as the image shows it [unit].
   * @param unit length of the unit of view_in_camera as far as it is known [m].
   * @return whether its place has jumped.
   */
  bool add(const Eigen::Isometry3d& camera, const Eigen::Isometry3d& view_in_camera, double unit);

  /**
   * What view_in_camera is measured by has changed, so that motions cannot be compared across it. Call it before the
   * next sight.
   * @param place pose of the view's camera as it was believed to be, in the frame of `camera` [m].
   */
  void restart(const Eigen::Isometry3d& place);

  /** The last sight is not to be trusted, for another reason than that its place has jumped. */
  void doubt();

  /** The view is not seen: the camera may have moved before the next sight, as odometry or the commands say. */
  void interrupt();

  /**
   * Whether the view may be taken for reached. False from the moment when its place jumps, or when it does not move as
   * the camera does, until the camera has moved before it and it does, from the sight after the jump on. True before the
   * first sight: a camera may be at the view.
   */
  bool trusted() const
  {
    return trusted_;
  }

  /**
   * Whether the camera has moved by `doubt` or `doubt_turn` while the view was seen to stay, or to move the other way.
   */
  bool contradicted() const
  {
    return doubtful_way_.contradicted || doubtful_turn_.contradicted;
  }

private:
  struct Sight
  {
    Eigen::Isometry3d camera;
    Eigen::Isometry3d view_in_camera;  // [unit]
  };
  enum class Verdict
  {
    OPEN,  // the camera has not moved enough
    ALIKE,
    OTHERWISE
  };

  /**
   * The camera's way, or its turn, since the view has last been seen to move as it does: the sum of those stretches over
   * which it was seen not to. To and fro is none.
   */
  struct Doubt
  {
    Sight from;           // of the stretch that is judged next
    double length = 0.0;  // [m] or [rad]
    bool contradicted = false;

    /**
     * @param verdict on the stretch from `from` to `now`. @param stretch its length, straight.
     * @param limit from which length on it is contradicted.
     */
    void add(Verdict verdict, double stretch, double limit, const Sight& now);
  };

  /** Of the view, in the frame of `camera` [m]. */
  static Eigen::Isometry3d placeOf(const Sight& sight, double unit);
  /**
   * Whether the view was seen to move as the camera did since an earlier sight.
   * @param way [m] and @param turn [rad] of the camera, one of which it has to reach.
   * @param least_turn part of the camera's turn that has to be seen.
   */
  static Verdict judge(const Sight& from, const Sight& to, double way, double turn, double least_turn);

  PlaceWatchLimits limits_;
  std::optional<Sight> last_;  // empty at first, and after restart()
  Sight proof_from_;
  std::optional<Eigen::Isometry3d> believed_;  // by restart()
  bool is_new_ = false;                        // the last sight was of another place than the one before
  bool trusted_ = true;
  bool interrupted_ = false;
  Doubt doubtful_way_;
  Doubt doubtful_turn_;
};

}  // namespace view_servo
