// A penny-shaped crack z = 0, r < 1 inside a sector of 30 degrees of a ball of radius 10; lengths in m
// made into penny.msh by: gmsh -3 penny.geo -format msh22 -bin
SetFactory("OpenCASCADE");
Sphere(1) = {0, 0, 0, 10, -Pi/2, Pi/2, Pi/6};
Disk(100) = {0, 0, 0, 1};
// the part of the disc in the ball becomes a surface inside the body, which the cells follow
part[] = BooleanIntersection { Surface{100}; Delete; }{ Volume{1}; };
BooleanFragments { Volume{1}; Delete; }{ Surface{part[]}; Delete; }
disc[] = Surface In BoundingBox {-0.1, -0.1, -0.1, 1.1, 0.6, 0.1};
south[] = Surface In BoundingBox {-0.1, -0.1, -11, 11, 0.1, 11};
oblique[] = Surface In BoundingBox {-0.1, -0.1, -11, 8.7, 5.1, 11};
oblique[] -= disc[];
Physical Volume("rock") = {1};
Physical Surface("disc") = disc[];
Physical Surface("south") = south[];
Physical Surface("oblique") = oblique[];
// cells grow in proportion to their distance from the front
front[] = Boundary { Surface{disc[]}; };
front[] -= Curve In BoundingBox {-0.1, -0.1, -0.1, 1.1, 0.1, 0.1};
front[] -= Curve In BoundingBox {-0.1, -0.1, -0.1, 0.9, 0.6, 0.1};
Field[1] = Distance;
Field[1].CurvesList = {front[]};
Field[1].Sampling = 400;
Field[2] = MathEval;
Field[2].F = "0.015 + 0.3*F1";
Background Field = 2;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;
